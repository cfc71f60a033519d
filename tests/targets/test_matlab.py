"""The MATLAB of kernels, run by Octave: bits of the C, words of the language, and what is told of faults."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from languages import DOUBLE, SAMPLES, check_lines

import strapgen
from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.cli import main
from strapgen.ir.exceptions import CompilerError
from strapgen.ir.sources import Sources
from strapgen.run import compiler, octave, standard_tree
from strapgen.run.backends import of_sources
from strapgen.targets.matlab import MATLAB, _MatlabPrinter

#: Functions of MATLAB without a toolbox that Octave has too: all that generated code calls.
_COMMON_TEXT = """
atan2 cos floor isempty max min mod nargin NaN repmat reshape sin size sqrt zeros
"""
COMMON = {*_COMMON_TEXT.split()}
#: Steps of a run, in more than one block of the loop.
STEPS = 1003
WORDS = {"function", "end", "if", "for"}


@pytest.fixture
def has_octave() -> None:
    """Skip a test where Octave is missing."""
    if reason := octave.missing():
        pytest.skip(reason)


def sources_of(choice: Choice) -> Sources:
    return pipeline.compile(choice, "matlab")


def bits(array: np.ndarray) -> bytes:
    """Return the bits of numbers; those of what is not a number tell nothing."""
    return np.where(np.isnan(array), np.nan, array).tobytes()


def differing(choices: Iterable[Choice], rng: np.random.Generator) -> list[str]:
    """Return the kernels that return other bits in Octave than in C, on many samples or on one."""
    several = list(choices)
    compiled = [pipeline.compile(choice, "c") for choice in several]
    compiler.compile_together(compiled)
    names = []
    for one, reference in zip(map(sources_of, several), compiled, strict=True):
        samples = [rng.uniform(-0.3, 0.3, (SAMPLES, *s.shape)) for s in one.function.inputs]
        expected = of_sources(reference).evaluate(samples, (SAMPLES,))
        many = of_sources(one).evaluate(samples, (SAMPLES,))
        single = of_sources(one).evaluate([array[0] for array in samples], ())
        same = all(
            bits(a) == bits(b) and bits(c) == bits(b[0])
            for a, b, c in zip(many, expected, single, strict=True)
        )
        names += [] if same and (one.attitude_step is None or same_run(one, reference, rng)) else [one.kernel]
    return names


def same_run(one: Sources, reference: Sources, rng: np.random.Generator) -> bool:
    """Return whether the loop of a step returns the bits that the step in C returns, called again and again."""
    state, samples = one.function.inputs
    start, rows = rng.uniform(-0.3, 0.3, state.shape), rng.uniform(-0.3, 0.3, (STEPS, *samples.shape))
    states = [start]
    for row in rows:
        states.append(of_sources(reference).evaluate([states[-1], row], ())[0])
    name, shape = f"{one.function.name}_propagate", (*state.shape, STEPS + 1)
    (history,) = octave.call([one], name, [start, np.moveaxis(rows, 0, -1)], [shape])
    return bits(np.moveaxis(history, -1, 0)) == bits(np.array(states))


def test_some_kernels_have_the_bits_of_c(has_octave, rng):
    assert differing([catalogue.choose(*words) for words in DOUBLE], rng) == []


@pytest.mark.long
def test_every_kernel_has_the_bits_of_c(has_octave, rng):
    assert len(catalogue.standard()) > 40
    assert differing(catalogue.standard(), rng) == []


def test_other_bits_are_seen(has_octave, rng, monkeypatch):
    printed = _MatlabPrinter.constant
    monkeypatch.setattr(
        _MatlabPrinter, "constant", lambda self, value: f"({printed(self, value)} * (1 + eps))"
    )
    program = pipeline.program(catalogue.choose("euler"))
    other = strapgen.generate(program, "matlab")
    monkeypatch.undo()
    reference = pipeline.compile(catalogue.choose("euler"), "c")
    assert not same_run(other, reference, rng)
    assert same_run(strapgen.generate(program, "matlab"), reference, rng)


def test_a_run_has_the_bits_of_c(has_octave, rng):
    increments = rng.uniform(-0.1, 0.1, (3, 23, 2, 3))
    for algorithm in ("euler", "dcm"):
        one, other = (strapgen.backend(algorithm, backend=name) for name in ("octave", "c"))
        for rest in ((1,), (4, 5)):
            assert bits(one.propagate(increments, *rest)) == bits(other.propagate(increments, *rest))
        assert one.propagate(increments[:, :0]).shape == other.propagate(increments[:, :0]).shape


def test_no_samples_give_no_results(has_octave):
    for words in DOUBLE:
        kernel = of_sources(sources_of(catalogue.choose(*words)))
        results = kernel.evaluate([np.empty((0, *s.shape)) for s in kernel.function.inputs], (0,))
        assert [result.shape for result in results] == [(0, *s.shape) for s in kernel.function.outputs]


def test_the_root_of_a_negative_number_is_no_number_as_in_c(has_octave):
    kernel = of_sources(sources_of(catalogue.choose("euler-angles-from-dcm")))
    text = kernel.sources.files["euler_angles_from_dcm.m"]
    broken = text.replace("square_root(cosine_squared)", "square_root(-1 - cosine_squared)")
    assert broken != text
    changed = replace(kernel.sources, files={"euler_angles_from_dcm.m": broken})
    roll, pitch, _ = of_sources(changed)(np.eye(3), np.zeros(3))
    assert (roll, np.isnan(pitch)) == (0, True)


def foreign(text: str) -> set[str]:
    """Return the functions that a file of generated MATLAB calls beside its own."""
    plain = re.sub(r"%.*| \.\.\.\n", "", text)
    signatures = re.findall(r"^function (.*?)(\w+)\((.*)\)$", plain, re.MULTILINE)
    held = set(re.findall(r"\w+", " ".join(" ".join(parts) for parts in signatures)))
    held |= set(re.findall(r"^ *(?:for )?(\w+)(?:\([^=]*\))? = ", plain, re.MULTILINE))
    return set(re.findall(r"(?<![\w.])[A-Za-z]\w*", plain)) - held - WORDS


def test_text_is_valid_in_matlab_and_octave():
    """No MATLAB is at hand here: neither an operator nor a word of Octave alone stands in the text, and no toolbox."""
    calls: set[str] = set()
    for choice in [*catalogue.standard()[::4], *(catalogue.choose(*words) for words in DOUBLE)]:
        sources = sources_of(choice)
        check_lines(sources)
        for text in sources.files.values():
            plain = re.sub(r"%.*", "", text)
            assert not re.findall(r"""["#!{}|]|[-+*/]=|\+\+|--""", plain)
            assert len(re.findall(r"^function\b", plain, re.MULTILINE)) == len(
                re.findall(r"^end$", plain, re.MULTILINE)
            )
            calls |= foreign(text) - {sources.function.name}
    assert calls == COMMON


def test_a_call_of_another_function_is_seen():
    first = "function y = f(x, ...\n    z)\n    w = x(1) + norm(z); % a sum\n    y = g(w);\nend\n"
    text = f"{first}\nfunction y = g(x)\n    y = x;\nend\n"
    assert foreign(text) == {"norm"}


def test_words_of_matlab_name_no_quantity():
    scopes = MATLAB.scopes(["function y = f(x) % end\n    y = sin(x) .* 'end';\nend\n\nfunction g()\nend\n"])
    assert scopes == [{"y", "f", "x", "sin", "end"}, {"g", "end"}]
    for word in ("end", "arguments", "_x", "x" * 64):
        assert not MATLAB.allows(word)
    assert MATLAB.allows("x" * 63)


def test_a_kernel_of_one_word_hides_no_function_of_matlab():
    program = pipeline.program(catalogue.choose("euler-normalize"))
    for name, function in (("norm", "norm_Kernel"), ("euler_norm", "euler_norm"), ("end", "end_Kernel")):
        sources = strapgen.generate(replace(program, name=name), "matlab")
        assert (sources.function.name, list(sources.files)) == (function, [f"{function}.m"])


def test_the_command_generates_names_and_checks(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def run(text: str) -> tuple[int, str]:
        with pytest.raises(SystemExit) as stop:
            main(text.split())
        return stop.value.code or 0, capsys.readouterr().err

    assert run("generate euler --target matlab --name turn --with-runs")[0] == 0
    text = (tmp_path / "turn.m").read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["turn.m", "turn_propagate.m"]
    command = standard_tree.command_of(text)
    assert command == "strapgen generate euler --method rk4 --increments 2 --name turn --target matlab"
    assert run(f"{command.removeprefix('strapgen ')} --check") == (0, "")
    assert run("generate euler-normalize --target matlab --name turn")[1].startswith(
        f"strapgen: turn.m is there, generated by '{command}'"
    )
    assert run("generate euler --target matlab --name end") == (
        2,
        "strapgen: end is a word of MATLAB and Octave itself; another name of the function is needed\n",
    )


def test_functions_of_one_name_are_distinguished(has_octave):
    sources = sources_of(catalogue.choose("euler-normalize"))
    (name, text), *_ = sources.files.items()
    negative = replace(sources, files={name: re.sub(r"next = \[(.*)\];", r"next = -[\1];", text)})
    for _ in range(2):
        signs = [np.sign(of_sources(one)([0.6, 0, 0, 0.8]))[3] for one in (sources, negative)]
        assert signs == [1, -1]


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("next = [", "next = no_such_function() * [", "'no_such_function' undefined"),
        ("next = [", "next = 1i * [", "output 1 of euler_normalize is no array of real doubles"),
        ("next = [", "next = [1; ", "it returned 5 numbers; 4 are needed"),
        ("next = [", "next = ([", "parse error"),
    ],
)
def test_octave_errors_are_reported_in_one_line(has_octave, old, new, reason):
    sources = sources_of(catalogue.choose("euler-normalize"))
    broken = replace(sources, files={name: text.replace(old, new) for name, text in sources.files.items()})
    with pytest.raises(CompilerError, match="Octave failed on euler-normalize: ") as caught:
        of_sources(broken)([0.6, 0, 0, 0.8])
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
    assert of_sources(sources)([0.6, 0, 0, 0.8])[0] == 0.6


@pytest.mark.posix
def test_octave_that_has_ended_is_told_and_started_again(has_octave):
    kernel = of_sources(sources_of(catalogue.choose("euler-normalize")))
    exits = replace(
        kernel.sources,
        files={
            name: text.replace("next = [", "exit(1); next = [") for name, text in kernel.sources.files.items()
        },
    )
    with pytest.raises(CompilerError, match="Octave has ended before it was done"):
        of_sources(exits)([0.6, 0, 0, 0.8])
    assert kernel([0.6, 0, 0, 0.8])[0] == 0.6
    (process,) = octave._running
    os.kill(process._process.pid, signal.SIGKILL)
    process._process.wait()
    assert kernel([0.6, 0, 0, 0.8])[0] == 0.6
    assert not process._folder.exists()
