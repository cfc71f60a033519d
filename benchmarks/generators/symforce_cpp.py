"""SymForce: its C++ generator, on scalars."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import symforce

symforce.set_epsilon_to_number()

import symforce.symbolic as sf  # noqa: E402
from symforce.codegen import Codegen, CppConfig  # noqa: E402
from symforce.values import Values  # noqa: E402

from generators import Case, formulas  # noqa: E402

LANGUAGE = "c++"


def version() -> str:
    """Return the version of the generator."""
    return str(symforce.__version__)


def write(case: Case, folder: Path) -> None:
    """Write the step of a case into a folder."""
    kernel = formulas.kernel(case)
    state, samples = formulas.inputs(kernel)
    symbols = {name: sf.Symbol(name) for name in (*state, *samples)}
    results = formulas.translated(kernel, symbols, sf.Rational)
    outputs = {f"out_{k}": result for k, result in enumerate(results)}
    codegen = Codegen(inputs=Values(**symbols), outputs=Values(**outputs), config=CppConfig(), name="step_of")
    with tempfile.TemporaryDirectory() as out:
        made = codegen.generate_function(output_dir=Path(out), skip_directory_nesting=True)
        (header,) = (path for path in made.generated_files if os.fspath(path).endswith(".h"))
        text = Path(header).read_text().replace("#include <Eigen/Core>", "#include <cmath>")
    arguments = [f"state[{k}]" for k in range(len(state))] + [f"samples[{k}]" for k in range(len(samples))]
    arguments += [f"&out[{k}]" for k in range(len(results))]
    call = f"    sym::StepOf<double>({', '.join(arguments)});\n"
    (folder / "step.inc").write_text(f"{text}\n{formulas.calling(call, len(results))}")
