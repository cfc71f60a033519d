"""A project of Python that compiles generated C by cffi: typed functions of numpy arrays, and a test of vectors."""

from __future__ import annotations

from dataclasses import dataclass

from strapgen.firmware.packages import code_in, rendered
from strapgen.firmware.project import Project
from strapgen.firmware.prototypes import Parameter, Prototype, declarations, prototypes
from strapgen.firmware.vectors_c import table_files

#: Types of numpy by those of C.
_TYPES = {"double": "float64", "float": "float32"} | {
    f"{sign}int{bits}_t": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}
#: What a function changes in place; every other output is a new array.
_RESIDUALS = "residuals"


@dataclass(frozen=True)
class _Binding:
    """A function as Python calls it."""

    prototype: Prototype
    #: The struct of its first parameter; "" without one
    memory: str
    parameters: tuple[Parameter, ...]

    @classmethod
    def of(cls, prototype: Prototype) -> _Binding:
        first, *others = prototype.parameters
        if first.type.endswith("_memory"):
            return cls(prototype, first.type, tuple(others))
        return cls(prototype, "", prototype.parameters)

    @property
    def name(self) -> str:
        name = self.prototype.name
        return name.removeprefix(f"{self.memory.removesuffix('_memory')}_") if self.memory else name

    @property
    def inputs(self) -> list[Parameter]:
        return [one for one in self.parameters if not one.is_output or one.name == _RESIDUALS]

    @property
    def outputs(self) -> list[Parameter]:
        return [one for one in self.parameters if one.is_output and one.name != _RESIDUALS]


def python_files(project: Project) -> dict[str, str]:
    """Return the files of a package of Python."""
    headers = project.sources.step_files
    texts = [headers[name] for name in reversed(project.code(".h"))]
    bindings = [_Binding.of(one) for text in texts for one in prototypes(text)]
    package = f"strapgen_{project.name}"
    files = {
        "pyproject.toml": "pyproject.toml",
        "setup.py": "setup.py",
        "MANIFEST.in": "MANIFEST.in",
        "build_extension.py": "build_extension.py",
        f"src/{package}/__init__.py": "package.py",
        f"src/{package}/py.typed": "py.typed",
        "tests/test_vectors.py": "test_vectors.py",
    }
    tables = {table.sources.function.name: table for table in project.tables}
    return {
        **code_in(project, "c", "c"),
        **rendered(
            "python",
            project,
            files,
            declarations="\n".join(map(declarations, texts)),
            functions=[one for one in bindings if not one.memory],
            memory=next((one.memory for one in bindings if one.memory), ""),
            methods=[one for one in bindings if one.memory],
            dtypes=_TYPES,
            residuals=_RESIDUALS,
            tables=tables,
        ),
        **{
            f"tests/{name}": text
            for table in project.tables
            for name, text in table_files(table).items()
            if name.endswith(".csv")
        },
    }
