"""The thesis's closing questions: when does round-off dominate, and when quantization.

Three sweeps of Euler parameters on the coning motion of the thesis's table 5, in the integer model.
"""

from strapgen import study


def sweep(**values):
    """Run a sweep and return its outcomes by whatever is asked of their cases."""
    return list(study.run(study.cases(**values)))


def words():
    """Print the drift against word length, with and without residuals."""
    outcomes = {
        (o.case.word, o.case.carry): o
        for o in sweep(words=(12, 16, 20, 24, 28, 32), carries=("none", "full"))
    }
    floor = next(iter(outcomes.values())).truncation_deg
    print(f"step 0.125 s: the method itself drifts by {floor:.1e} deg in 180 s\n")
    print("what the arithmetic adds, deg, and the certified bound")
    print(f"{'word':>4}{'nothing kept':>16}{'certified':>11}{'residuals kept':>18}{'certified':>11}")
    for word in sorted({word for word, _ in outcomes}):
        cells = [
            (outcomes[word, carry].rounding_deg, outcomes[word, carry].bound_deg)
            for carry in ("none", "full")
        ]
        (plain, bound), (kept, kept_bound) = cells
        print(f"{word:>4}{plain:>16.1e}{bound:>11.1e}{kept:>18.1e}{kept_bound:>11.1e}")
    print()


def orders():
    """Print when a shorter step stops to help: truncation falls, round-off without residuals grows."""
    print("16 bits, nothing kept: drift from the truth, deg")
    methods, steps = ("rk2", "rk3", "rk4"), ("0.5", "0.25", "0.125", "0.0625")
    found = {
        (o.case.method, o.case.step): o
        for o in sweep(words=(16,), carries=("none",), methods=methods, steps=steps)
    }
    print("step, s " + "".join(f"{method:>12}" for method in methods))
    for step in steps:
        cells = []
        for method in methods:
            outcome = found[method, step]
            cells.append(f"{outcome.drift_deg:.1e} {outcome.dominates[0]}")
        print(f"{step:<8}" + "".join(f"{cell:>12}" for cell in cells))
    print("most from: t truncation, r round-off, q rounded increments\n")


def quantization():
    """Print when gyro pulses dominate."""
    print("residuals kept: drift from the truth against the gyro's pulse, deg")
    words, pulses = (16, 24, 32), ("0.03", "0.3", "3", "30")
    found = {
        (o.case.word, o.case.pulse_arcsec): o
        for o in sweep(words=words, carries=("full",), pulses_arcsec=pulses)
    }
    print("pulse, arcsec" + "".join(f"{f'{word} bits':>14}" for word in words))
    for pulse in pulses:
        cells = [found[word, pulse] for word in words]
        print(f"{pulse:<13}" + "".join(f"{o.drift_deg:>12.1e} {o.dominates[0]}" for o in cells))
    print("most from: t truncation, r round-off, q the gyro's pulses")


def main():
    words()
    orders()
    quantization()


if __name__ == "__main__":
    main()
