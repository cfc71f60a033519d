"""From a formula to C, stage by stage: what each stage of the generator holds."""

import sympy as sp

import strapgen


def main():
    kernel = strapgen.derive("euler", method="rk2", increments=2)
    print(kernel.title)
    vector_part = kernel.expand()["next"][0]
    print(f"e_x after a step, expanded: {sp.count_ops(sp.expand(vector_part))} operations")

    program = strapgen.lower(kernel)
    print(f"the whole step, lowered: {program.operations}")

    sources = strapgen.generate(program, "c")
    declaration = next(
        line for line in sources.files["euler_rk2_2.h"].splitlines() if line.startswith("void")
    )
    print(declaration)

    backend = strapgen.build(sources)
    print(backend.step(backend.identity, [[0.0, 0.0, 0.01], [0.0, 0.0, 0.01]]))


if __name__ == "__main__":
    main()
