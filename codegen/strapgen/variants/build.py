"""Generates variants, and compares the files in their folders with generated ones."""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from strapgen.cli import generate_command, program
from strapgen.cli.project_kinds import DEFAULT
from strapgen.ir.exceptions import CompilerError, StrapgenError
from strapgen.results.records import entry
from strapgen.results.result import Result
from strapgen.storage.drafts import temporary_folder
from strapgen.variants.variant_file import CostLimit, Variant, words_of

#: Seconds after which a test of vectors has hung.
_HANGS_S = 300


@dataclass(frozen=True)
class Step:
    """A command of a build, or a test that it runs."""

    variant: str = field(metadata=entry(header="variant"))
    command: str = field(metadata=entry(header="command"))
    holds: bool = field(metadata=entry(header="holds"))
    #: What it printed, or why it does not hold
    output: str = field(metadata=entry(header="output"))

    @property
    def line(self) -> str:
        """The step in a line, with what it printed where it does not hold."""
        if self.holds:
            return f"ok    {self.variant}: {self.command}"
        return "\n".join(
            [f"FAILS {self.variant}: {self.command}", *(f"  {one}" for one in self.output.splitlines())]
        )


@dataclass(frozen=True)
class BuildResult(Result):
    """The steps of a build."""

    rows_in = "steps"

    steps: tuple[Step, ...]
    holds: bool

    def text(self) -> str:
        """Return what was done; the steps stand above it, as they came."""
        failed = sum(not step.holds for step in self.steps)
        return f"{len(self.steps)} steps, {f'{failed} of them failed' if failed else 'all hold'}"


def generate(variant: Variant) -> Iterator[Step]:
    """Write the files of a variant."""
    for words in _each(variant):
        yield _command(variant, ["generate", *words])
        if _has_own_vectors(variant) and _is_compiled(words):
            yield _command(variant, ["vectors", *words, *_count(variant), "--out", _folder(variant)])


def check(variant: Variant) -> Iterator[Step]:
    """Hold the files of a variant: in step, verified, with vectors that pass, within limits of cost, with evidence."""
    for words in _each(variant):
        in_step = _command(variant, ["generate", *words, "--check"])
        yield in_step
        if not _is_compiled(words):
            continue
        name, plain = _function(words), _is_plain(variant)
        if variant.checks.verify and in_step.holds and plain:
            yield _command(variant, ["verify", str(Path(_folder(variant)) / f"{name}.c")])
        if _has_own_vectors(variant):
            yield _same_vectors(variant, words)
        if plain and (variant.checks.vectors or variant.options.get("project")):
            yield _run_vectors(variant, name)
        for limit in variant.checks.cost:
            yield _cost(variant, words, limit)
        if variant.checks.evidence and "c-fixed" in words:
            tools = [] if "all" in variant.checks.evidence else ["--tool", ",".join(variant.checks.evidence)]
            yield _command(variant, ["evidence", *_without_target(words), *tools, "--complete"])


def _each(variant: Variant) -> Iterator[list[str]]:
    """Yield the options that choose each target and word of a variant."""
    from strapgen.targets import TARGETS

    for target in variant.targets:
        entry = TARGETS.get(target)
        for word in variant.words if entry is None or entry.fixed else (None,):
            chosen = [] if word is None else ["--word", str(word)]
            yield ["--variant", variant.name, "--target", target, *chosen]


def _without_target(words: list[str]) -> list[str]:
    place = words.index("--target")
    return words[:place] + words[place + 2 :]


def _is_compiled(words: list[str]) -> bool:
    from strapgen.targets import TARGETS

    return TARGETS[words[words.index("--target") + 1]].compiled


def _folder(variant: Variant) -> str:
    return str(words_of(variant.name, "generate", []).get("out", "."))


def _is_plain(variant: Variant) -> bool:
    """Return whether the C stands in the folder itself, as with one kind of project alone."""
    return variant.options.get("project") in (None, False, True, DEFAULT)


def _has_own_vectors(variant: Variant) -> bool:
    """Return whether vectors are written by themselves; a project has its own."""
    return bool(variant.checks.vectors) and not variant.options.get("project")


def _count(variant: Variant) -> list[str]:
    return ["--count", str(variant.checks.vectors)]


def _function(words: list[str]) -> str:
    """Return the name of the files of a function in C."""
    from strapgen import pipeline

    stated = dict(words_of(words[1], "generate", words))
    stated |= {"targets": words[words.index("--target") + 1]}
    if "--word" in words:
        stated["word"] = words[words.index("--word") + 1]
    values = generate_command.generate.__dict__["options"].typed(stated)
    task = generate_command.request(
        values["algorithm"], values["method"], values["targets"][0], values["fixed"], values["output"]
    )
    return pipeline.compile(*task).function.name


def _command(variant: Variant, words: Sequence[str]) -> Step:
    """Run a command of strapgen in this process."""
    status, output = _output(words)
    return Step(variant.name, shlex.join(["strapgen", *words]), status == 0, output)


def _output(words: Sequence[str]) -> tuple[int, str]:
    """Return the exit status and the output of a command."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            status = program.run(list(words))
    except StrapgenError as error:
        return 2, f"{printed.getvalue()}{error}"
    return status if isinstance(status, int) else 0, printed.getvalue()


def _same_vectors(variant: Variant, words: list[str]) -> Step:
    """Compare the vectors in the folder with new ones."""
    from strapgen.run import standard_tree

    with temporary_folder() as folder:
        command = ["vectors", *words, *_count(variant)]
        status, output = _output([*command, "--out", str(folder)])
        new = {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.iterdir())}
    difference = standard_tree.difference(Path(_folder(variant)), new)
    shown = f"files of {shlex.join(['strapgen', *command])}"
    return Step(variant.name, shown, not (status or difference), output if status else difference)


def _run_vectors(variant: Variant, name: str) -> Step:
    """Compile the test of vectors with the C and run it."""
    from strapgen.run.compiler import C

    folder = Path(_folder(variant))
    sources = [folder / f"{name}.c", folder / f"test_{name}.c"]
    command = f"test of {name} on its vectors"
    for path in sources:
        if not path.is_file():
            return Step(variant.name, command, False, f"{path} is not there; strapgen build writes it")
    with temporary_folder() as place:
        program = place / "test"
        try:
            build = [*C.command(), "-O1", *map(str, sources), "-o", str(program), "-lm"]
            for words in (build, [str(program)]):
                done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=_HANGS_S)
                if done.returncode:
                    return Step(variant.name, command, False, done.stdout + done.stderr)
        except (OSError, subprocess.TimeoutExpired, CompilerError) as error:
            return Step(variant.name, command, False, str(error))
    return Step(variant.name, command, True, done.stdout)


def _cost(variant: Variant, words: list[str], limit: CostLimit) -> Step:
    """Measure the cost on a processor and hold it to its limits."""
    command = ["cost", *words, "--cpu", limit.cpu, "--format", "json"]
    status, output = _output(command)
    shown = shlex.join(["strapgen", *command[:-2]])
    if status:
        return Step(variant.name, shown, False, output)
    (row,) = json.loads(output)
    over = [
        f"{key} is {row[key]}, at most {most} is allowed"
        if row.get(key) is not None
        else f"{key} is not measured; QEMU counts it"
        for key in ("executed", "code_bytes", "stack_bytes")
        if (most := getattr(limit, key)) is not None and (row.get(key) is None or row[key] > most)
    ]
    return Step(variant.name, shown, not over, "\n".join(over))


def build(variants: Sequence[Variant], checking: bool) -> Iterator[Step]:
    """Yield the steps of several variants as they are done; generating ends at the first failure."""
    for variant in variants:
        for step in check(variant) if checking else generate(variant):
            yield step
            if not step.holds and not checking:
                return
