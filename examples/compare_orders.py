"""Which order pays? Drift of Euler parameters on a coning motion, for four orders and three steps, in C."""

import numpy as np

import strapgen


def main():
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
    print("mean drift over 160 s, deg")
    print("step, s " + "".join(f"{method:>12}" for method in ("rk1", "rk2", "rk3", "rk4")))
    for step in ("0.5", "0.25", "0.125"):
        drifts = []
        for method in ("rk1", "rk2", "rk3", "rk4"):
            backend = strapgen.backend("euler", method, backend="c")
            run = strapgen.simulate(backend, motion, step, 160, orthonormalize=5, record=5)
            drifts.append(np.degrees(run.mean_drift))
        print(f"{step:<8}" + "".join(f"{drift:>12.3e}" for drift in drifts))


if __name__ == "__main__":
    main()
