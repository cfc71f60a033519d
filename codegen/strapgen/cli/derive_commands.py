"""The commands ``strapgen list``, ``derive`` and ``schema``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import typer

from strapgen import registration
from strapgen.cli.option_groups import Needs, Shown, grouped, rules
from strapgen.cli.options import Algorithm, MethodOptions, argument, option
from strapgen.cli.output import TEXT_OUTPUT, Folder, Output
from strapgen.cli.values import names
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.registry import Titles
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: The kinds of names, in the order in which they are listed.
KINDS = (
    *("algorithms", "methods", "vectors", "kernels"),
    *(kind for one in reversed(registration.built_in().values()) for kind in one.lists),
    *("targets", "backends"),
)


@grouped
def list_names(
    kind: Annotated[
        str | None,
        argument("KIND", help=f"Kind of names: {', '.join(KINDS)}.  [default: all]", words=KINDS),
    ] = None,
    *,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """List all names that the other commands take.

    Example: strapgen list methods

    Example: strapgen list kernels --format markdown
    """
    output.check()
    if kind is not None:
        kind = checks.choice(
            "kind", kind if kind in KINDS else f"{kind}s" if f"{kind}s" in KINDS else kind, KINDS
        )
    for line in registration.broken():
        typer.echo(f"strapgen: {line}", err=True)
    parts = _parts()
    shown = parts if kind is None else {kind: parts[kind]}
    short = dict(shown)
    if kind is None:
        short["methods"] = _with_one_line_for_taylor(parts["methods"])
        short["kernels"] = _with_one_line_for_updates(parts["kernels"])
    groups = _groups_of_kernels(shown["kernels"]) if kind == "kernels" else None
    output.show(NamesResult(shown, groups, short, kind is None))


def _parts() -> dict[str, dict[str, str]]:
    from strapgen import catalogue
    from strapgen.catalogue.user import loading
    from strapgen.run.backends import BACKENDS
    from strapgen.targets import titles

    installed = {
        name: f"from {point.value}"
        for name, point in loading.installed().items()
        if name not in (*catalogue.ALGORITHMS, *catalogue.KERNELS, *catalogue.LAYOUT_KERNELS)
    }
    return {
        "algorithms": {**catalogue.ALGORITHMS, **installed},
        "methods": {**catalogue.METHODS, **catalogue.INTEGRATORS.taken()},
        "vectors": {
            name: f"{vector.title}; methods {', '.join(vector.methods)}"
            for name, vector in catalogue.VECTORS.items()
        },
        "kernels": {
            **Titles(catalogue.KERNELS),
            **Titles(catalogue.LAYOUT_KERNELS),
            **catalogue.KERNELS.taken(),
        },
        **registration.lists(),
        "targets": titles(),
        "backends": {**Titles(BACKENDS), **BACKENDS.taken()},
    }


def _groups_of_kernels(names: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the names of kernels by the modules that derive them, in words; those of packages come last."""
    from strapgen import catalogue

    groups: dict[str, list[str]] = {}
    for name in names:
        recipe = catalogue.KERNELS.own.get(name) or catalogue.LAYOUT_KERNELS.get(name)
        module = recipe.module.rpartition(".")[2] if recipe else "installed_packages"
        groups.setdefault(module.removesuffix("_kernels").replace("_", " "), []).append(name)
    return dict(sorted(groups.items(), key=lambda group: group[0] == "installed packages"))


def _with_one_line_for_taylor(methods: dict[str, str]) -> dict[str, str]:
    """Return the methods with the Taylor series of all orders on one line."""
    series = [name for name in methods if name.startswith("taylor")]
    others = {name: title for name, title in methods.items() if name not in series}
    return others | {f"{series[0]} to {series[-1]}": "Taylor series of the transition, of any order to 20"}


def _with_one_line_for_updates(kernels: dict[str, str]) -> dict[str, str]:
    """Return the kernels with the updates of an algorithm by a rotation vector, of all orders, on one line."""
    from strapgen import catalogue

    first, *_, last = catalogue.UPDATE_ORDERS
    lines = {}
    updates = {
        f"{algorithm}-update-{order}": (order, title)
        for algorithm, title in catalogue.ALGORITHMS.items()
        for order in catalogue.UPDATE_ORDERS
    }
    for name, title in kernels.items():
        order, algorithm = updates.get(name, (None, ""))
        if order is None:
            lines[name] = title
        elif order == first:
            lines[f"{name} to {last}"] = f"{algorithm}: update by a rotation vector, order {first} to {last}"
    return lines


@dataclass(frozen=True)
class NamesResult(Result):
    """Names with their meanings, by kind."""

    kinds: Mapping[str, Mapping[str, str]] = field(metadata=entry(spread=True))
    #: Of kernels alone: their names by purpose
    groups: Mapping[str, Sequence[str]] | None = field(metadata=entry(optional=True))
    #: The same with series of names on one line, for the text
    short: Mapping[str, Mapping[str, str]] = field(metadata=INTERNAL)
    #: Whether these are all kinds
    every: bool = field(metadata=INTERNAL)

    def rows(self) -> list[tuple[str, ...]]:
        """Return names with meanings, after the kind if there are several."""
        return [
            (*([kind] if self.every else []), *item)
            for kind, part in self.kinds.items()
            for item in part.items()
        ]

    def table(self) -> TextTable:
        """Return the names as a table."""
        names = [*(["kind"] if self.every else []), "name", "meaning"]
        return TextTable([Column(name, "<") for name in names], self.rows())

    def _headings(self) -> Mapping[str, Mapping[str, str]]:
        """Return what the text shows: the kernels by group, or the kinds."""
        if self.groups is None:
            return self.short
        titles = self.short["kernels"]
        return {group: {name: titles[name] for name in names} for group, names in self.groups.items()}

    def text(self) -> str:
        """Return the names of each kind, or of each group of kernels."""
        width = max(len(name) for part in self.short.values() for name in part)
        columns = (Column(align="<", least=width), Column(align="<"))
        lines = []
        headed = self.every or self.groups is not None
        for heading, part in self._headings().items():
            lines += [heading] if headed else []
            lines += TextTable(columns, list(part.items())).lines("  " if headed else "")
        return "\n".join(lines)


@grouped
@rules(Needs("--format=csv|markdown", "--show=program|operations"))
def derive(
    algorithm: Algorithm,
    *,
    method: MethodOptions,
    show: Annotated[
        str,
        option(
            "--show",
            metavar="NAME",
            help="What to show: text or latex (the formulas), program, or operations.",
            panel="Output",
            read=names(("text", "latex", "program", "operations")),
        ),
    ] = "text",
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """Show the formulas, the program or the operations of a kernel.

    The program is lowered from the formulas. It and the operations are tables, which --format csv, markdown and latex
    write; of the formulas, latex shows a step in vectors.

    Example: strapgen derive euler --method rk4 --increments 2 --show operations
    """
    output.check(algorithm, *method.files)
    choice = method.choose(algorithm, step=False)
    from strapgen import pipeline
    from strapgen.results.display.formulas import KernelResult

    kernel = pipeline.derive(choice)
    without_program = kernel.unknowns and show in ("text", "latex")
    output.show(KernelResult.of(kernel, None if without_program else pipeline.program(choice), show))


@grouped
def schema(
    name: Annotated[
        str | None,
        argument(
            "NAME",
            help="Name of a result or of a kind of files.  [default: list them]",
            words="strapgen.registration:schemas",
        ),
    ] = None,
    *,
    all_: Annotated[
        bool, option("--all", help="Write those of all results as files.", panel="Output")
    ] = False,
    out: Folder = None,
) -> None:
    """Print the JSON Schema of a result or of users' files.

    JSON says its schema under the key schema, as strapgen/comparison/1; a list says it in each row. Kinds of files end
    with .toml; their schemas come with the package too, in its folder schemas.

    Example: strapgen schema comparison

    Example: strapgen schema tableau.toml

    Example: strapgen schema --all --out out/schemas
    """
    from pathlib import Path

    from strapgen.results.result import as_json
    from strapgen.storage.files import write_files

    known = registration.schemas()
    if all_ and name is not None:
        raise InputError(f"--all writes all schemas; {name} does not go with it")
    if out is not None and not all_:
        raise InputError("--out goes with --all")
    if all_:
        files = {
            f"{name}.json": f"{as_json(one.read())}\n" for name, one in known.items() if one.kind == "result"
        }
        written = write_files(out or Path(), files)
        typer.echo(f"{out or Path()}: {len(written)} schemas")
    elif name is None:
        typer.echo("\n".join(f"{one.kind}  {name}" for name, one in known.items()))
    else:
        typer.echo(as_json(known[checks.choice("schema", name, known)].read()))
