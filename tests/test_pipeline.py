"""The front door: one composition of the stages, how long they take, and the way of a choice through the modules."""

from __future__ import annotations

import inspect
import logging
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest

import strapgen
from strapgen import pipeline, targets
from strapgen.catalogue import Choice, choose, derivation
from strapgen.cli import main
from strapgen.ir.exceptions import InputError
from strapgen.run.kernel_sources import Request
from strapgen.storage import cache

PACKAGE = str(Path(strapgen.__file__).parent)
EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "modified_rodrigues.py"
#: The functions that take the choice on its way from the command line to the text of C, in order: the name of the
#: algorithm until it is chosen, then the choice, or a request that holds it.
WALK = """
cli.option_groups _process
cli.option_groups grouped.<locals>.run
cli.option_groups Option.value
cli.generate_command generate
cli.generate_command request
cli.options MethodOptions.choose
catalogue.choosing choose
catalogue.choice named
ir.checks require
registry Merged.__contains__
catalogue.choosing _choose_method
cli.fixed_options FixedOptions.check_increments
storage.cache cached.<locals>.decorate.<locals>.recall
pipeline compile
pipeline fixed_program
pipeline program
catalogue.derivation derive
catalogue.derivation _of_catalogue
cli.generate_command SourceOptions.files
cli.generated_result GeneratedSources.of
"""


@pytest.fixture
def empty_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Let everything be derived anew: no entry on disk, no program in memory."""
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "cache"))
    derivation._of_catalogue.cache_clear()
    return tmp_path


def run(*words: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0


def arguments(frame: FrameType) -> Iterator[object]:
    """Yield the arguments of a call; a method of the choice itself does not take it from anywhere."""
    code, values = frame.f_code, frame.f_locals
    count = code.co_argcount + code.co_kwonlyargcount
    for name in code.co_varnames[:count]:
        if name != "self" or not isinstance(values[name], Choice):
            yield values[name]
    if code.co_flags & inspect.CO_VARARGS:
        yield from values[code.co_varnames[count]]
        count += 1
    if code.co_flags & inspect.CO_VARKEYWORDS:
        yield from values[code.co_varnames[count]].values()


def walk(*words: str) -> list[str]:
    """Run a command; return the functions that take the choice, each once, in the order of their first call."""
    functions: dict[str, None] = {}
    chosen: list[object] = []

    def look(frame: FrameType, event: str, value: object) -> None:
        if not frame.f_code.co_filename.startswith(PACKAGE):
            return
        if event == "return" and isinstance(value, Choice):
            chosen.append(value)
        elif event == "call" and any(
            isinstance(each, (Choice, Request)) or (not chosen and each == words[1])
            for each in arguments(frame)
        ):
            module = frame.f_globals["__name__"].removeprefix("strapgen.")
            functions[f"{module} {frame.f_code.co_qualname}"] = None

    sys.setprofile(look)
    try:
        run(*words)
    finally:
        sys.setprofile(None)
    return list(functions)


def test_a_choice_walks_through_few_functions(empty_cache):
    functions = walk("generate", "euler", "--target", "c-fixed", "--out", str(empty_cache))
    assert functions == WALK.split("\n")[1:-1], "\n".join(functions)


@pytest.mark.long
def test_compiling_is_the_stages_in_order():
    choice = choose("euler", "rk2", 1)
    program = strapgen.lower(strapgen.derive("euler", "rk2", 1))
    for target in targets.TARGETS:
        word = strapgen.Settings(16) if targets.TARGETS[target].fixed else None
        code = strapgen.quantize(program, word) if targets.TARGETS[target].fixed else program
        assert pipeline.compile(choice, target, word) == strapgen.generate(code, target)


def test_bad_targets_and_settings_are_refused_before_anything_is_derived(monkeypatch):
    def never(_choice: Choice) -> None:
        raise AssertionError("derived")

    choice, cases = (
        choose("euler"),
        [("cobol", None, "'cobol' is not known"), ("c", 16, "takes no fixed-point")],
    )
    for target, word, message in [*cases, ("c-fixed", 24, "word is 24; in C it is 16, 32, 64 bits")]:
        with pytest.raises(InputError, match=message):
            pipeline.compile(choice, target, word and strapgen.Settings(word), never)


def test_settings_beside_a_quantized_program_are_refused():
    fixed = strapgen.quantize(strapgen.lower(strapgen.derive("euler-product")))
    with pytest.raises(InputError, match="euler-product is quantized already; settings do not go with it"):
        strapgen.generate(fixed, "c-fixed", strapgen.Settings(16))


def test_targets_take_their_own_kind_of_program():
    program = strapgen.lower(strapgen.derive("euler-product"))
    with pytest.raises(
        InputError, match="target c does not take fixed-point programs; these do: c-fixed, cpp-fixed"
    ):
        targets.emit(strapgen.quantize(program), "c")
    with pytest.raises(InputError, match="target c-fixed takes quantized programs alone"):
        targets.emit(program, "c-fixed")


def test_deriving_takes_names_or_a_complete_choice():
    assert pipeline.derive(choose("dcm", "rk2", 1)) == pipeline.derive("dcm", "rk2", 1)
    for options in ({"method": "rk2"}, {"increments": 1}, {"rates": True}, {"previous": 1}):
        with pytest.raises(InputError, match="but the choice of dcm-rk2-1 has its own"):
            pipeline.derive(choose("dcm", "rk2", 1), **options)


# How long the stages take


@pytest.fixture
def stage_log(caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    with caplog.at_level(logging.INFO, logger="strapgen"):
        yield caplog


def test_every_stage_is_timed(empty_cache, stage_log):
    strapgen.backend("euler", "rk1", 1, "c-fixed32")
    records = [(r.stage, r.what) for r in stage_log.records if r.name == "strapgen" and r.seconds > 0]
    assert records == [
        *((stage, "euler-rk1-1") for stage in ("derive", "lower", "quantize")),
        ("generate", "euler-rk1-1 for c-fixed"),
        *[("compile", "euler-rk1-1"), ("build", "euler-rk1-1 for c-fixed")],
    ]


def test_a_stage_that_fails_has_no_time(stage_log):
    program = strapgen.lower(strapgen.derive("coning-truth"))
    stage_log.clear()
    with pytest.raises(InputError):
        strapgen.quantize(program)
    assert not stage_log.records


def test_verbose_shows_stages_and_cache_hits_on_stderr(empty_cache, capsys):
    words = ("generate", "euler", "--target", "c", "--out", str(empty_cache))
    run("--verbose", *words)
    first = capsys.readouterr()
    assert re.fullmatch(
        r"derive euler-rk4-2: \d+\.\d{3} s\nlower euler-rk4-2: \d+\.\d{3} s\n"
        r"generate euler-rk4-2 for c: \d+\.\d{3} s\n",
        first.err,
    )
    cache._results.clear()  # as another process
    run("--verbose", *words)
    second = capsys.readouterr()
    assert second.err == "sources of euler-rk4-2 for c: from the cache\n"
    run(*words)
    third = capsys.readouterr()
    assert third.err == ""
    assert first.out == second.out == third.out


@pytest.mark.long
def test_verbose_tells_of_users_kernels(empty_cache, capsys):
    words = ("--verbose", "generate", str(EXAMPLE), "--out", str(empty_cache))
    run(*words)
    assert capsys.readouterr().err.startswith(f"derive {EXAMPLE}: ")
    run(*words)
    assert capsys.readouterr().err.startswith(f"kernel of {EXAMPLE}: from the cache\n")


def test_verbose_ends_with_its_command(empty_cache, capsys):
    with pytest.raises(SystemExit):
        main(["--verbose", "generate", "eulr"])
    assert not logging.getLogger("strapgen").handlers
    assert logging.getLogger("strapgen").level == logging.NOTSET
