"""Building: one compilation for each content and compiler, and clear words where there is no compiler."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from navigation.described_files import description
from small_systems import COUNTING

import strapgen
from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.cli import main
from strapgen.ir.exceptions import CompilerError
from strapgen.ir.sources import Sources
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.run import backends as run
from strapgen.run import compiler

SIMULATE = ["simulate", "euler", "--method", "rk1", "--increments", "1", "--step", "1", "--duration", "2"]
SIMULATE += ["--motion", "constant", "--set", "x_deg_s=1"]


@pytest.fixture(autouse=True)
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Start with an empty cache, on disk and in memory, and the machine's own compiler."""
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(compiler, "_loaded", {})
    monkeypatch.setattr(compiler, "_modules", {})
    monkeypatch.delenv("CC", raising=False)
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def sources() -> Sources:
    return pipeline.generate(pipeline.lower(pipeline.derive("euler-normalize")), "c")


@pytest.fixture
def counting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return a compiler that counts its calls, and the count."""
    script, log = tmp_path / "counting-cc", tmp_path / "log"
    log.write_text("")
    script.write_text(f'#!/bin/sh\necho "$@" >> {log}\nexec {shutil.which("cc")} "$@"\n')
    script.chmod(0o755)
    monkeypatch.setenv("CC", str(script))
    return lambda: len(log.read_text().splitlines())


@pytest.fixture
def without_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide every compiler."""
    (tmp_path / "nothing").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))


@pytest.mark.posix
def test_a_compiled_function_is_called_and_a_second_time_nothing_is_compiled(
    sources, counting, root, monkeypatch
):
    first = compiler.load(sources)
    result = first.ffi.new("double[4]")
    first.lib.euler_normalize([0.0, 0.0, 3.0, 4.0], result)
    np.testing.assert_allclose(list(result), [0, 0, 0.6, 0.8])
    calls = counting()
    assert calls > 0
    assert compiler.load(sources) is first
    monkeypatch.setattr(compiler, "_loaded", {})  # as another process
    again = compiler.load(sources)
    assert again.__file__ == first.__file__
    assert counting() == calls
    (place,) = (root / "builds").iterdir()
    kept = {path.name for path in place.iterdir()} - {"manifest.json"}
    assert kept == {Path(first.__file__).name}, "only what is loaded is kept"


@pytest.mark.posix
def test_other_text_and_another_compiler_compile_again(sources, counting, root, monkeypatch):
    compiler.load(sources)
    calls = counting()
    files = {name: text.replace("Euler", "Euler's") for name, text in sources.files.items()}
    compiler.load(replace(sources, files=files))
    assert counting() == 2 * calls
    assert len(list((root / "builds").iterdir())) == 2
    monkeypatch.setenv("CC", "cc -Wall")
    monkeypatch.setattr(compiler, "_loaded", {})
    compiler.load(sources)
    assert len(list((root / "builds").iterdir())) == 3
    assert os.environ["CC"] == "cc -Wall", "the environment is put back"


def test_blank_choice_of_compiler_is_none(sources, monkeypatch):
    for blank in ("", "  "):
        monkeypatch.setenv("CC", blank)
        assert compiler.C.path() == shutil.which("cc")
    assert compiler.load(sources).lib.euler_normalize
    assert os.environ["CC"] == "  "


def test_cache_folder_may_be_relative(sources, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", "relative")
    assert compiler.load(sources).lib.euler_normalize
    assert "CC" not in os.environ
    assert len(list((tmp_path / "relative" / "builds").iterdir())) == 1


# No compiler, or a bad one


def test_no_compiler(sources, without_compiler, root):
    with pytest.raises(CompilerError, match=r"^no C compiler: 'cc' is not on the PATH; install gcc .*numpy"):
        compiler.load(sources)
    assert not (root / "builds").exists()


@pytest.mark.parametrize("chosen", ["strange-cc -O2", "/nowhere/cc", "'unclosed", '""'])
def test_chosen_compiler_is_not_there(chosen, sources, monkeypatch):
    monkeypatch.setenv("CC", chosen)
    with pytest.raises(
        CompilerError, match=r"^no C compiler: .* is not on the PATH; install gcc \(or set CC\)"
    ):
        compiler.load(sources)


@pytest.mark.posix
@pytest.mark.parametrize("chosen", [None, "cl", "CL.exe -W3", "clang-cl"])
def test_msvc_is_told_from_the_compilers_that_can_be_used(
    chosen, sources, without_compiler, root, monkeypatch
):
    """It is found where there is no other one, or chosen."""
    folder = Path(os.environ["PATH"])
    for name in ("clang-cl" if chosen is None else chosen.split()[0], "CL.exe"):
        (folder / name).write_text("#!/bin/sh\nexit 3\n")
        (folder / name).chmod(0o755)
    if chosen is not None:
        monkeypatch.setenv("CC", chosen)
    with pytest.raises(
        CompilerError, match=r"(cl|CL\.exe) takes the options of MSVC; .*GCC or Clang is needed: .*CC"
    ):
        compiler.load(sources)
    assert not (root / "builds").exists()


def test_on_windows_the_library_of_python_is_named(monkeypatch):
    options = compiler._linking()
    assert "-shared" in options or "-bundle" in options
    assert not any(word.startswith("-lpython3") for word in options)
    monkeypatch.setattr(compiler, "_ON_WINDOWS", True)
    monkeypatch.setattr(sys, "base_prefix", "/python")
    folder, library = f"-L{Path('/python', 'libs')}", "-lpython{}{}".format(*sys.version_info)
    assert compiler._linking() == ["-shared", folder, library]


def test_numpy_works_without_a_compiler(without_compiler):
    history = strapgen.backend("euler", "rk4", 2, "numpy").propagate(np.full((3, 2, 3), 0.01))
    assert np.isfinite(history).all()


def test_generation_works_without_a_compiler(without_compiler, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["generate", "euler", "--target", "c", "--out", str(tmp_path / "out")])
    assert stop.value.code == 0
    assert (tmp_path / "out" / "euler_rk4_2.c").is_file()


@pytest.mark.long
@pytest.mark.parametrize("backend", ["c", "c-float"])
def test_command_line_without_a_compiler(backend, without_compiler, capsys):
    with pytest.raises(SystemExit) as stop:
        main([*SIMULATE, "--backend", backend])
    assert stop.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("strapgen: no C compiler: ")
    assert said.err.count("\n") == 1
    with pytest.raises(SystemExit) as stop:
        main([*SIMULATE, "--backend", "numpy"])
    assert stop.value.code == 0


def test_version_without_a_compiler(without_compiler, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--version"])
    assert stop.value.code == 0
    assert "C compiler is not installed" in capsys.readouterr().out


@pytest.mark.posix
def test_compiler_that_fails(sources, root, monkeypatch, capfd):
    monkeypatch.setenv("CC", "false")
    with pytest.raises(CompilerError, match=r"false failed on strapgen_euler_normalize") as failure:
        compiler.load(sources)
    assert "\n" not in str(failure.value)
    assert list((root / "builds").iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_source_that_does_not_compile(sources, root, capfd):
    files = {name: text.replace("#include", "#error no") for name, text in sources.files.items()}
    with pytest.raises(CompilerError, match=r"failed on strapgen_euler_normalize: .*error.* no") as failure:
        compiler.load(replace(sources, files=files))
    assert "\n" not in str(failure.value)
    assert list((root / "builds").iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_flags_of_the_environment_do_not_reach_the_compiler(sources, root, monkeypatch):
    for name in ("CFLAGS", "CPPFLAGS", "LDFLAGS"):
        monkeypatch.setenv(name, "-no-such-flag-at-all")
    assert compiler.load(sources).lib.euler_normalize


@pytest.mark.posix
def test_failing_compiler_is_reported_in_one_line(sources, root, monkeypatch, capfd):
    monkeypatch.setenv("CC", "cc -no-such-flag-at-all")
    with pytest.raises(CompilerError, match=r"cc failed on strapgen_\w+: .*error.*no-such-flag-at-all"):
        compiler.load(sources)
    assert capfd.readouterr() == ("", "")
    assert not list((root / "builds").iterdir())


@pytest.mark.posix
def test_a_compiler_that_makes_nothing(sources, root, monkeypatch):
    monkeypatch.setenv("CC", "true")
    with pytest.raises(CompilerError, match="failed on"):
        compiler.load(sources)
    assert not list((root / "builds").iterdir())


# Many in one module


@pytest.fixture(scope="module")
def many() -> list[Sources]:
    names = ("euler-normalize", "dcm-from-euler")
    lowered = [pipeline.lower(pipeline.derive(name)) for name in names]
    return [pipeline.generate(program, target) for target in ("c", "c-float", "numpy") for program in lowered]


@pytest.mark.posix
@pytest.mark.long
def test_many_sources_become_one_module_in_one_command(many, counting, root, monkeypatch, tmp_path):
    """Each function is the one that it is alone."""
    compiler.compile_together(many)
    assert counting() == 1
    (place,) = (root / "builds").iterdir()
    modules = {compiler.load(sources) for sources in many if sources.target != "numpy"}
    assert {Path(module.__file__).parent for module in modules} == {place}
    assert len(modules) == 1
    together = [run.of_sources(sources) for sources in many]
    assert counting() == 1
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "other"))
    monkeypatch.setattr(compiler, "_loaded", {})
    rng = np.random.default_rng(7)
    for sources, function in zip(many, together, strict=True):
        alone = run.of_sources(sources)
        values = [
            rng.normal(size=(9, *signal.shape)).astype(alone.dtype) for signal in sources.function.inputs
        ]
        np.testing.assert_array_equal(function(*values), alone(*values))
        if sources.target != "numpy":
            assert function.module.__file__ != alone.module.__file__


@pytest.mark.posix
def test_existing_modules_are_not_compiled_again(many, counting):
    first = many[0]
    compiler.load(first)
    calls = counting()
    compiler.compile_together([first])
    assert counting() == calls
    compiler.compile_together(many)
    assert counting() == calls + 1
    calls = counting()
    compiler.compile_together(many)
    assert counting() == calls


@pytest.mark.posix
def test_functions_of_one_name_go_into_two_modules(sources, counting, root):
    """Each module has one kernel: it is what `load` compiles of that alone, and found without a pointer."""
    pair = [sources, other(sources, 1)]
    compiler.compile_together(pair)
    calls = counting()
    shutil.rmtree(root / "shared", ignore_errors=True)
    assert len(list((root / "builds").iterdir())) == 2
    assert len({compiler.load(one).__file__ for one in pair}) == 2
    assert counting() == calls


def test_a_module_of_many_that_is_gone_is_compiled_alone(many, root, monkeypatch):
    compiler.compile_together(many)
    shutil.copytree(root, root.with_name("other"))
    for kind, place in (("builds", root), ("shared", root.with_name("other"))):
        monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(place))
        monkeypatch.setattr(compiler, "_loaded", {})
        for entry in (place / kind).iterdir():
            shutil.rmtree(entry)
        module = compiler.load(many[0])
        assert module.lib.euler_normalize
        assert Path(module.__file__).name.startswith("strapgen_euler_normalize")
        assert Path(module.__file__).is_relative_to(place)


def test_many_without_a_compiler(many, without_compiler, root):
    with pytest.raises(CompilerError, match=r"^no C compiler: 'cc' is not on the PATH"):
        compiler.compile_together(many)
    assert not (root / "builds").exists()
    compiler.compile_together([sources for sources in many if sources.target == "numpy"])


def test_one_of_many_that_does_not_compile(many, root):
    first = many[0]
    files = {name: text.replace("#include", "#error no") for name, text in first.files.items()}
    broken = replace(first, files=files)
    with pytest.raises(CompilerError, match=r"error.* no"):
        compiler.compile_together([broken, *many[1:]])
    assert not list((root / "builds").iterdir())
    assert not (root / "shared").exists()


# Sources that differ


def other(sources: Sources, number: int) -> Sources:
    """Return sources that differ in a comment."""
    files = {
        name: text + (f"/* {number} */\n" if name.endswith(".c") else "")
        for name, text in sources.files.items()
    }
    return replace(sources, files=files)


def _compile_in_a_fork(sources: Sources, made) -> None:
    made.put(compiler.load(sources) is not None)


@pytest.mark.posix
def test_a_fork_compiles_beside_the_process_that_it_comes_from(sources):
    compiler.load(sources)
    context = multiprocessing.get_context("fork")
    made = context.SimpleQueue()
    child = context.Process(target=_compile_in_a_fork, args=(other(sources, 2), made))
    child.start()
    assert compiler.load(other(sources, 3)).lib.euler_normalize
    child.join(60)
    assert made.get()


def test_threads_compile_at_once(sources):
    with ThreadPoolExecutor(2) as pool:
        modules = list(pool.map(lambda number: compiler.load(other(sources, number)), (4, 5)))
    assert all(module.lib.euler_normalize for module in modules) and len({*map(id, modules)}) == 2


@pytest.mark.posix
def test_stages_of_a_system_are_compiled_together_and_only_where_they_are_called(sources, counting, tmp_path):
    compiler.load(sources)
    of_one_module = counting()
    runner = system_runner(description(tmp_path, COUNTING, "counted.toml"), "c")
    runner.run({"counts": np.zeros((4, 3))})
    assert counting() == 2 * of_one_module
    assert len(runner.evaluators) == 2
    assert counting() == 3 * of_one_module


@pytest.mark.posix
def test_back_ends_that_are_compared_are_compiled_together(sources, counting):
    compiler.load(sources)
    of_one_module = counting()
    rows = strapgen.compare("euler", "rk1", 1, ["c", "c-float", "c-fixed32"], np.full((5, 1, 3), 0.01))
    assert [row.backend for row in rows] == ["c", "c-float", "c-fixed32"]
    # One module has all kernels that are missing; the size of each step's code takes a call of its own.
    assert counting() == 2 * of_one_module + len(rows)


FAILING = "#!/bin/sh\necho 'no licence for this host' >&2\nexit 3\n"
SILENT = "#!/bin/sh\nexit 3\n"
NO_SHEBANG = "\x00"
LYING = """#!/bin/sh
while [ $# -gt 0 ]; do [ "$1" = "-o" ] && echo rubbish > "$2"; shift; done
exit 0
"""


@pytest.mark.posix
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FAILING, "failed on strapgen_euler_rk1_1: no licence for this host"),
        (SILENT, "strapgen_euler_rk1_1: exit "),
        (NO_SHEBANG, "strapgen_euler_rk1_1: Exec format error"),
        (LYING, "it reports success and writes no library"),
    ],
    ids=["failing", "silent", "no program", "lying"],
)
def test_compiler_that_fails_is_named_in_one_line(text, said, tmp_path, monkeypatch):
    check("CC", "c", text, said, tmp_path, monkeypatch)


@pytest.mark.posix
@pytest.mark.parametrize(("variable", "target"), [("CXX", "cpp"), ("RUSTC", "rust")])
@pytest.mark.parametrize(
    ("text", "said"),
    [(FAILING, "euler-rk1-1: no licence"), (LYING, "it reports success and writes no library")],
    ids=["failing", "lying"],
)
def test_compilers_of_other_languages_too(variable, target, text, said, tmp_path, monkeypatch):
    check(variable, target, text, said, tmp_path, monkeypatch)


def check(variable, target, text, said, tmp_path, monkeypatch) -> None:
    """Load a step with a compiler that is a script, twice."""
    path = tmp_path / "mycc"
    path.write_text(text)
    path.chmod(0o755)
    monkeypatch.setenv(variable, str(path))
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "cache"))
    sources = pipeline.compile(choose("euler", "rk1", 1), target)
    for _ in range(2):  # the cache keeps nothing of it
        with pytest.raises(CompilerError) as caught:
            compiler.load(sources)
        assert said in str(caught.value) and str(path) in str(caught.value)
        assert "CalledProcessError" not in str(caught.value) and "\n" not in str(caught.value)
        assert not list((tmp_path / "cache" / "builds").iterdir())
