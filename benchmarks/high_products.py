"""What high words of products alone cost on microcontrollers; prints the table of docs/fixed-point.md."""

from __future__ import annotations

from strapgen import catalogue, pipeline
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import places_above
from strapgen.lab import cost

#: Steps by the words of the table: representation, method, increments.
STEPS = {
    "`euler` of fourth order": ("euler", "rk4", 2),
    "`dcm` of fourth order": ("dcm", "rk4", 2),
    "`euler` by `window-7-7`": ("euler", "window-7-7", 1),
}
CPUS = ("cortex-m0", "cortex-m3", "cortex-m4", "rv32imc")
WAYS = ("product", "high", "half")


def row(step: str, multiply: str) -> str:
    """Return the row of a step and a way to multiply."""
    algorithm, method, increments = STEPS[step]
    settings = Settings.of(max_rate_deg_s=400, step="0.01", increments=increments, multiply=multiply)
    choice = catalogue.choose_step(algorithm, method, increments if method == "rk4" else None)
    sources = pipeline.compile(choice, "c-fixed", settings)
    assert sources.fixed is not None
    error = max(error / a.unit for a in sources.fixed.outputs for error in a.errors)
    executed = [f"{cost.cost(sources, cpu).executed:,}" for cpu in CPUS]
    first = f"{step} " if multiply == WAYS[0] else ""
    return f"| {first}| {multiply} | {' | '.join(executed)} | {places_above(error, 2)} |"


def main() -> None:
    """Measure and print the table."""
    for step in STEPS:
        for multiply in WAYS:
            print(row(step, multiply))


if __name__ == "__main__":
    main()
