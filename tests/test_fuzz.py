"""The corpus of the fuzzers is replayed, and the loop that fuzzes without atheris finds what there is to find."""

from __future__ import annotations

import shutil
import subprocess

import fuzz
import fuzz_targets
import pytest
from fuzz_targets import TARGETS, FindingError

from strapgen.evidence import clang_checks
from strapgen.evidence.collection import standard
from strapgen.ir.exceptions import InputError

pytestmark = pytest.mark.posix


@pytest.mark.parametrize("name", TARGETS)
def test_the_corpus_of_a_target_is_used_or_refused_in_one_line(name):
    for data in [*fuzz.corpus(name), *fuzz_targets.seeds(name)]:
        TARGETS[name](data)


def test_fuzz_targets_use_their_corpus(tmp_path, monkeypatch):
    """Otherwise the fuzzers would see no more than refusals."""
    refused = []

    def noted(read, value):
        try:
            read(value)
        except InputError as error:
            refused.append(str(error))

    monkeypatch.setattr(fuzz_targets, "_refused_or_read", noted)
    for name in TARGETS.keys() - {"header", "command-line"}:
        assert fuzz_targets.seeds(name)
        for data in fuzz_targets.seeds(name):
            TARGETS[name](data)
    assert refused == []


KERNELS = [path.stem for path in sorted(fuzz.CORPUS.glob("c_*.txt"))]


def test_the_corpus_of_the_c_is_small():
    sizes = [path.stat().st_size for path in fuzz.CORPUS.iterdir()]
    assert len(KERNELS) == 35
    assert sum(sizes) < 150_000
    assert max(len(fuzz.corpus(name)) for name in KERNELS) <= fuzz.MOST


def test_the_corpus_of_the_c_keeps_the_contract(tmp_path):
    """Compiled by gcc without a fuzzer; each kernel whose inputs are kept, all in one program after the other."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not on this machine")
    for subject in standard():
        if not subject.name.startswith(("euler_rk4", "dcm_orthonormalize", "coning_fast")):
            continue
        folder = tmp_path / subject.name
        folder.mkdir()
        files = clang_checks.fuzz_files(subject)
        for name, text in files.items():
            (folder / name).write_text(text)
        inputs = fuzz.corpus(f"c_{subject.name}")
        assert inputs
        for number, data in enumerate(inputs):
            (folder / f"{number}").write_bytes(data)
        code = [name for name in files if name.endswith(".c")]
        subprocess.run(["gcc", "-std=c99", "-O0", "-DREPLAY", *code, "-o", "replay"], cwd=folder, check=True)
        done = subprocess.run(
            ["./replay", *map(str, range(len(inputs)))],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, "")


def test_the_loop_finds_a_fault_behind_lines_that_only_some_inputs_reach(tmp_path):
    path = tmp_path / "strapgen_toy.py"
    path.write_text(
        "def read(data):\n    if data[:1] == b'[':\n        if data[1:2] == b'0':\n"
        "            if data[2:3] == b';':\n                raise KeyError('found')\n"
    )
    scope: dict = {}
    exec(compile(path.read_text(), str(path), "exec"), scope)
    tries = iter(range(20_000))
    data, error, inputs = fuzz.search(scope["read"], [], 1, lambda: next(tries, None) is not None)
    assert data is not None
    assert data[:3] == b"[0;"
    assert isinstance(error, KeyError)
    assert {entry[:1] for entry in inputs} > {b"["}


def test_the_loop_ends_without_a_finding():
    tries = iter(range(50))
    data, error, inputs = fuzz.search(lambda _: None, [b"a"], 1, lambda: next(tries, None) is not None)
    assert (data, error, inputs[0]) == (None, None, b"a")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["list"], None),
        (["nothing"], None),
        (["silent", 2, ""], "says []"),
        (["two lines", 2, "strapgen: a\nb\n"], "says ['strapgen: a', 'b']"),
        (["another status", 3, "strapgen: a\n"], "ends with 3"),
    ],
)
def test_a_command_line_says_one_line_with_status_2(words, said, monkeypatch):
    import sys

    monkeypatch.setattr(fuzz_targets, "words_of", lambda _: words)
    if len(words) > 1:

        def main(words):
            sys.stderr.write(words[2])
            sys.exit(words[1])

        monkeypatch.setattr(fuzz_targets.cli, "main", main)
    if said is None:
        fuzz_targets.command_line(b"")
    else:
        with pytest.raises(FindingError) as error:
            fuzz_targets.command_line(b"")
        assert said in str(error.value)


def test_an_error_of_python_is_a_finding(monkeypatch):
    def main(words):
        raise RuntimeError(words)

    monkeypatch.setattr(fuzz_targets.cli, "main", main)
    with pytest.raises(RuntimeError):
        fuzz_targets.command_line(b"")


def test_the_time_is_for_all_targets_together():
    shared = fuzz.jobs(300, ["readers", "command-line"], 2)
    assert sum(seconds for _, seconds in shared) == pytest.approx(600)
    assert {name for name, _ in shared} == {*TARGETS}


def test_script_refuses_unknown_arguments(capsys):
    with pytest.raises(SystemExit) as end:
        fuzz.main(["--only", "c,docs"])
    assert end.value.code == 2
    assert "'docs' is not known; allowed: c, readers, command-line" in capsys.readouterr().err
