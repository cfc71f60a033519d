"""Operations of the Jacobians of an attitude step by strapgen and by general code generators, counted on their code.

Every generator differentiates the same formulas, as slopes of the state or as the transition and one product, whichever
leads it to fewer operations, and searches common subexpressions in its own way. What it writes runs
on numbers that count; functions of the library are left out on all sides.

    python benchmarks/jacobians.py [--limit S]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
#: Steps: algorithm, method, increments, and increments from before the step.
STEPS = (
    ("euler", "rk4", 2, 0),
    ("dcm", "rk4", 2, 0),
    ("euler", "coning-combined", 3, 3),
    ("dcm", "coning-combined", 3, 3),
)
GENERATORS = ("strapgen", "SymForce", "wrenfold", "CasADi")


def formulas(step: tuple, symbols: dict, number, functions: dict) -> list:
    """Return the next state of a step in the symbols of another system."""
    from strapgen.kernel.kernel import evaluate_stages

    kernel = _kernel(step)
    if step[-1] == "staged":  # as in a textbook: slopes of the state
        from generators import Case
        from generators import formulas as textbook

        kernel = textbook.kernel(Case(step[0], "increments", "staged"))

    def function(expression, arguments):
        name = type(expression).__name__
        if name == "sinc":
            return functions["sin"](arguments[0]) / arguments[0]
        if name == "Pow" and expression.exp.q == 2 and expression.exp.p == 1:
            return functions["sqrt"](arguments[0])
        return functions[name](arguments[0])

    known = evaluate_stages(
        (*kernel.stages, *kernel.outputs), symbols, lambda r: number(int(r.p), int(r.q)), function
    )
    return [known[name] for name in kernel.outputs[-1].signal.elements]


def _kernel(step: tuple):
    import strapgen

    algorithm, method, increments, previous, _ = step
    return strapgen.derive(algorithm, method, increments=increments, previous=previous or None)


def _names(step) -> list[str]:
    return [name for signal in _kernel(step).inputs for name in signal.elements]


def write_strapgen(step, folder: Path) -> int:
    """Write the Jacobians of strapgen, and return how many numbers they are."""
    from strapgen import pipeline
    from strapgen.catalogue import choose

    algorithm, method, increments, previous, _ = step
    choice = choose(f"{algorithm}-jacobian", method, increments, previous=previous or None)
    sources = pipeline.compile(choice, "c", None)
    for name, text in sources.files.items():
        (folder / name).write_text(text)
    function = sources.function
    rows, columns = function.outputs[0].size, function.outputs[1].size
    body = (folder / f"{function.name}.c").name
    (folder / "step.inc").write_text(
        f'#include "{body}"\nstatic void step(const double *state, const double *samples, double *next)\n'
        f"{{\n    {function.name}(state, samples, next, next + {rows});\n}}\n"
    )
    return rows + columns


def write_symforce(step, folder: Path) -> int:
    """Write the Jacobians by SymForce."""
    import symforce

    symforce.set_epsilon_to_number()
    import symforce.symbolic as sf
    from symforce.codegen import Codegen, CppConfig
    from symforce.values import Values

    names = _names(step)
    symbols = {name: sf.Symbol(name) for name in names}
    results = formulas(step, symbols, sf.Rational, {"sin": sf.sin, "cos": sf.cos, "sqrt": sf.sqrt})
    outputs = {
        f"out_{k}": sf.diff(result, symbols[name])
        for k, (result, name) in enumerate((r, n) for r in results for n in names)
    }
    codegen = Codegen(inputs=Values(**symbols), outputs=Values(**outputs), config=CppConfig(), name="step_of")
    made = codegen.generate_function(output_dir=folder, skip_directory_nesting=True)
    (header,) = (Path(path) for path in made.generated_files if str(path).endswith(".h"))
    text = header.read_text().replace("#include <Eigen/Core>", "#include <cmath>")
    return _calling(folder, text, "sym::StepOf<double>", step, len(outputs), "&")


def write_wrenfold(step, folder: Path) -> int:
    """Write the Jacobians by wrenfold."""
    import inspect

    import wrenfold
    from wrenfold import sym

    names = _names(step)
    numbers: list[int] = []

    def bound(**symbols):
        results = formulas(step, symbols, sym.rational, {"sin": sym.sin, "cos": sym.cos, "sqrt": sym.sqrt})
        slopes = [result.diff(symbols[name]) for result in results for name in names]
        numbers.append(len(slopes))
        return [wrenfold.OutputArg(slope, name=f"out_{k}") for k, slope in enumerate(slopes)]

    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    bound.__signature__ = inspect.Signature(
        [inspect.Parameter(n, kind, annotation=wrenfold.FloatScalar) for n in names]
    )
    bound.__annotations__ = dict.fromkeys(names, wrenfold.FloatScalar)
    text = wrenfold.generate_function(bound, generator=wrenfold.CppGenerator(), name="step_of")
    return _calling(folder, f"#include <cmath>\n{text}", "step_of<double>", step, numbers[-1], "")


def write_casadi(step, folder: Path) -> int:
    """Write the Jacobians by CasADi, of its scalar graphs and with its own search for common subexpressions."""
    import os

    import casadi

    names = _names(step)
    vector = casadi.SX.sym("x", len(names))
    symbols = {name: vector[k] for k, name in enumerate(names)}
    functions = {"sin": casadi.sin, "cos": casadi.cos, "sqrt": casadi.sqrt}
    results = formulas(step, symbols, lambda p, q: casadi.SX(p) / q, functions)
    slopes = casadi.densify(casadi.jacobian(casadi.vertcat(*results), vector)).T
    function = casadi.Function("generated", [vector], [casadi.cse(casadi.vec(slopes))])
    os.chdir(folder)  # it writes into the current folder alone
    function.generate("generated.c")
    size = len(_kernel(step).inputs[0].elements)
    (folder / "step.inc").write_text(
        '#include "generated.c"\n'
        "static void step(const double *state, const double *samples, double *next)\n{\n"
        f"    double all[{len(names)}];\n"
        f"    for (int k = 0; k < {len(names)}; ++k)\n"
        f"        all[k] = k < {size} ? state[k] : samples[k - {size}];\n"
        "    const double *arguments[1] = {all};\n    double *results[1] = {next};\n"
        "    casadi_f0(arguments, results, 0, 0, 0);\n}\n"
    )
    return len(results) * len(names)


def _calling(folder: Path, text: str, function: str, step, outputs: int, reference: str) -> int:
    """Write the step by a call of a function of scalars."""
    state, samples = (len(signal.elements) for signal in _kernel(step).inputs)
    arguments = [f"state[{k}]" for k in range(state)] + [f"samples[{k}]" for k in range(samples)]
    arguments += [f"{reference}next[{k}]" for k in range(outputs)]
    (folder / "step.inc").write_text(
        f"{text}\nstatic void step(const double *state, const double *samples, double *next)\n"
        f"{{\n    {function}({', '.join(arguments)});\n}}\n"
    )
    return outputs


WRITERS = {
    "strapgen": write_strapgen,
    "SymForce": write_symforce,
    "wrenfold": write_wrenfold,
    "CasADi": write_casadi,
}


def count(generator: str, step, limit: float) -> str:
    """Return the additions and multiplications of a generator's Jacobians, or why there are none."""
    with tempfile.TemporaryDirectory() as name:
        words = [sys.executable, __file__, "--write", generator, json.dumps(step), name]
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=limit)
        except subprocess.TimeoutExpired:
            return f"not in {limit:g} s"
        if done.returncode:
            return (done.stderr.strip().splitlines() or ["failed"])[-1]
        state, samples, outputs = json.loads(done.stdout.splitlines()[-1])
        sizes = [f"-DSTATE={state}", f"-DSAMPLES={samples}", f"-DOUTPUTS={outputs}"]
        program = Path(name) / "count"
        build = ["g++", "-std=c++14", "-w", "-fpermissive", f"-I{name}", *sizes, str(HERE / "count.cpp")]
        built = subprocess.run([*build, "-o", str(program)], capture_output=True, text=True)
        if built.returncode:
            return next((line for line in built.stderr.splitlines() if "error" in line), "does not compile")
        multiply, add, divide, _ = map(int, subprocess.run([program], capture_output=True).stdout.split())
        return f"{multiply + add + divide}"


def least(generator: str, step: tuple, limit: float) -> str:
    """Return the least count over the forms in which a generator is given the formulas."""
    forms = ["transition", "staged"] if step[1] == "rk4" and generator != "strapgen" else ["transition"]
    counts = [count(generator, (*step, form), limit) for form in forms]
    numbers = [int(text) for text in counts if text.isdigit()]
    return str(min(numbers)) if numbers else counts[0]


def main() -> None:
    """Print a table, or write the code of one generator for one step."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--limit", type=float, default=300.0, help="seconds that a generator may take")
    parser.add_argument("--write", nargs=3)
    options = parser.parse_args()
    sys.path.insert(0, str(HERE))
    if options.write:
        generator, text, folder = options.write
        step = tuple(json.loads(text))
        outputs = WRITERS[generator](step, Path(folder))
        print(json.dumps([*(len(signal.elements) for signal in _kernel(step).inputs), outputs]))
        return
    print("additions, multiplications and divisions of both Jacobians of a step")
    print(f"{'step':32}" + "".join(f"{name:>14}" for name in GENERATORS))
    for step in STEPS:
        algorithm, method, increments, previous = step
        label = f"{algorithm} {method} {increments}" + (f"+{previous}" if previous else "")
        print(f"{label:32}" + "".join(f"{least(g, step, options.limit):>14}" for g in GENERATORS), flush=True)


if __name__ == "__main__":
    main()
