"""Kernels of users in the cache: derived once, and again when anything that they were made of has changed."""

from __future__ import annotations

import pickle
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from commands import run
from users_files import STEP, beside, written

import strapgen
from strapgen.catalogue import choose
from strapgen.catalogue.user import loading
from strapgen.ir.exceptions import InputError
from strapgen.storage import cache

#: Says on stderr that the file runs.
SAYS = "print('derived')\n"


@pytest.fixture
def derives(capsys: pytest.CaptureFixture[str]):
    """Tell whether a file runs, and return its kernel's title."""

    def derive(path: str, **options) -> tuple[bool, str]:
        capsys.readouterr()
        kernel = strapgen.derive(path, **options)
        said = capsys.readouterr()
        assert said.out == "" and said.err in ("", "derived\n")
        return bool(said.err), kernel.title

    return derive


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return a file with a helper, and a cache of this test's own."""
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "cache"))
    path = written(tmp_path / "own" / "own.py", SAYS + "from helper import WORD")
    beside(path, helper="from base import WORD\n", base="WORD = 'one'\n")
    return path


def test_a_file_is_derived_once(derives, file):
    kernel = strapgen.derive(file)
    assert strapgen.derive(file) == kernel
    derives(file)
    assert derives(file) == (False, "one")


@pytest.mark.long
@pytest.mark.parametrize("name", ["own", "helper", "base"])
def test_a_change_of_any_module_derives_again(derives, file, name):
    derives(file)
    path = Path(file).with_name(f"{name}.py")
    path.write_text(path.read_text() + "WORD = 'two'\n")
    assert derives(file) == (True, "two")
    assert derives(file) == (False, "two")


def test_a_module_that_hides_another_derives_again(derives, tmp_path, file, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path / "library")
    (tmp_path / "library").mkdir()
    Path(file).with_name("base.py").rename(tmp_path / "library" / "base.py")
    assert [derives(file)[0], derives(file)] == [True, (False, "one")]
    beside(file, base="WORD = 'two'\n")
    assert derives(file) == (True, "two")


def test_a_module_that_was_missing_derives_again(derives, file):
    beside(file, helper="try:\n    from extra import WORD\nexcept ImportError:\n    WORD = 'one'\n")
    assert [derives(file), derives(file)] == [(True, "one"), (False, "one")]
    beside(file, extra="WORD = 'two'\n")
    assert derives(file) == (True, "two")


@pytest.mark.parametrize(
    "reading",
    [
        "pathlib.Path(__file__).with_name('word.txt').read_text()",
        "open(os.path.dirname(__file__) + '/word.txt').read()",
    ],
)
def test_a_change_of_data_derives_again(derives, file, reading):
    beside(file, helper=f"import os, pathlib\nWORD = {reading}\n")
    data = Path(file).with_name("word.txt")
    data.write_text("one")
    assert [derives(file), derives(file)] == [(True, "one"), (False, "one")]
    data.write_text("two")
    assert derives(file) == (True, "two")
    data.unlink()
    with pytest.raises(InputError, match="FileNotFoundError"):
        strapgen.derive(file)


def test_options_and_copies_are_told_apart(derives, file, tmp_path):
    text = (
        Path(file)
        .read_text()
        .replace("algorithm()", "algorithm(increments=2)")
        .replace("(1, 3), (", "(1, 3), (")
    )
    Path(file).write_text(text.replace("str(WORD)", "str(WORD) + str(increments)"))
    assert [derives(file, increments=count) for count in (1, 2, 1, 2)] == [
        (True, "one1"),
        (True, "one2"),
        (False, "one1"),
        (False, "one2"),
    ]
    other = tmp_path / "other" / "own.py"
    other.parent.mkdir()
    other.write_text(Path(file).read_text())
    beside(str(other), helper="WORD = 'elsewhere'\n")
    assert derives(str(other), increments=1) == (True, "elsewhere1")


def test_another_generator_derives_again(derives, file, monkeypatch):
    derives(file)
    monkeypatch.setattr(cache, "generator_digest", lambda: "another generator")
    assert derives(file) == (True, "one")


@pytest.mark.parametrize("name", ["kernel.pickle", "record.json", "manifest.json"])
@pytest.mark.parametrize("damage", [lambda path: path.write_bytes(path.read_bytes()[:-9]), Path.unlink])
def test_a_damaged_entry_is_derived_again(derives, file, name, damage):
    derives(file)
    (entry,) = cache.root().joinpath("kernels").iterdir()
    damage(entry / name)
    assert [derives(file), derives(file)] == [(True, "one"), (False, "one")]


#: Starts a process that ends at once, and waits for it.
CHILD = "{}\nif not pid:\n    os._exit(0)\nos.waitpid(pid, 0)\nWORD = 'one'\n"
#: Has another process work something out.
WORKER = (
    "import multiprocessing\nworker = multiprocessing.get_context('spawn').Process(target=abs, args=(1,))\n"
    "worker.start()\nworker.join()\nWORD = worker.exitcode\n"
)


@pytest.mark.parametrize(
    "helper",
    [
        "import os\nWORD = len(os.listdir(os.path.dirname(__file__)))\n",
        "import glob\nWORD = len(glob.glob(__file__ + '*'))\n",
        pytest.param("import os\nWORD = os.system('true')\n", marks=pytest.mark.posix),
        "WORD = 'one'\nopen(__file__ + '.log', 'a').close()\n",
        pytest.param("import os\n" + CHILD.format("pid = os.fork()"), marks=pytest.mark.posix),
        pytest.param("import os\n" + CHILD.format("pid, terminal = os.forkpty()"), marks=pytest.mark.posix),
        pytest.param(
            "import os\nos.waitpid(os.posix_spawn('/bin/true', ['true'], {}), 0)\nWORD = 'one'\n",
            marks=pytest.mark.posix,
        ),
        "import os\ntry:\n    os.execv(__file__ + '.none', ['none'])\nexcept OSError:\n    WORD = 'one'\n",
        WORKER,
        "import sqlite3\nsqlite3.connect(':memory:').close()\nWORD = 'one'\n",
        pytest.param("import ctypes\nWORD = ctypes.CDLL(None).abs(-1)\n", marks=pytest.mark.posix),
    ],
    ids=[
        *("listing", "pattern", "program", "writing", "fork", "terminal", "spawn", "exec"),
        *("worker", "database", "library"),
    ],
)
def test_kernels_that_depend_on_more_than_files_are_not_cached(derives, file, helper):
    beside(file, helper=helper)
    assert [derives(file)[0], derives(file)[0]] == [True, True]


def test_kernel_with_user_class_is_not_cached(derives, file):
    beside(file, helper="WORD = 'one'\n")
    text = Path(file).read_text().replace("def algorithm", "class Note(str):\n    pass\n\ndef algorithm")
    Path(file).write_text(text.replace("str(WORD)", "Note(WORD)"))
    assert [derives(file), derives(file)] == [(True, "one"), (True, "one")]


def test_generated_c_in_the_process_is_no_module_of_the_user_s(derives, file):
    strapgen.backend("euler", backend="c")
    assert [derives(file), derives(file)] == [(True, "one"), (False, "one")]


def test_an_algorithm_that_is_made_of_another_one_follows_it(derives, file, tmp_path):
    other = written(tmp_path / "other" / "own.py", "from helper import WORD")
    beside(other, helper="WORD = 'inner'\n")
    beside(file, helper=f"import strapgen\nWORD = strapgen.derive({other!r}).title + ' and outer'\n")
    assert derives(file) == (True, "inner and outer")
    beside(other, helper="WORD = 'changed'\n")
    assert derives(file) == (True, "changed and outer")


def test_failed_derivations_are_not_cached(derives, file):
    beside(file, base="WORD = '\\n'\n")
    for _ in range(2):
        with pytest.raises(InputError, match="its title is no text of one line"):
            strapgen.derive(file)
    beside(file, base="WORD = 'one'\n")
    assert derives(file)[1] == "one"


def test_a_cache_that_cannot_be_written_is_done_without(derives, file, tmp_path, monkeypatch):
    (tmp_path / "no folder").write_text("")
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / "no folder"))
    assert [derives(file), derives(file)] == [(True, "one"), (True, "one")]


def test_the_command_in_the_code_is_the_one_that_was_typed(derives, file, tmp_path, monkeypatch):
    derives(file)
    monkeypatch.chdir(tmp_path)
    assert (strapgen.derive("own/own.py").arguments, derives("own/own.py")[0]) == ("own/own.py", False)


def test_an_entry_point_is_derived_once_and_again_after_a_change(derives, file, tmp_path, monkeypatch):
    package = tmp_path / "packages" / "gyros"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "words.py").write_text("WORD = 'one'\n")
    (package / "own.py").write_text(
        STEP.format(beginning=SAYS + "from gyros.words import WORD", inside="pass", title="WORD")
    )
    monkeypatch.syspath_prepend(package.parent)
    point = EntryPoint("gyro", "gyros.own:algorithm", loading.GROUP)
    monkeypatch.setattr(loading, "entry_points", lambda group: [point])
    assert [derives("gyro"), derives("gyro")] == [(True, "one"), (False, "one")]
    (package / "words.py").write_text("WORD = 'two'\n")
    assert [derives("gyro"), derives("gyro")] == [(True, "two"), (False, "two")]


def test_text_in_the_cache_is_written_again_without_sympy(file, tmp_path, capsys):
    targets = ("c", "numpy")
    for target in targets:
        run(["generate", file, "--target", target, "--out", str(tmp_path / "with" / target)])
    # Another process, which has none of these modules, does the same from the cache.
    program = """
import contextlib, sys
sys.modules.update(dict.fromkeys(("sympy", "jinja2", "mpmath")))
from strapgen.cli import main
for target in sys.argv[3:]:
    with contextlib.suppress(SystemExit):
        main(["generate", sys.argv[1], "--target", target, "--out", f"{sys.argv[2]}/{target}"])
"""
    command = [sys.executable, "-c", program, file, str(tmp_path / "without"), *targets]
    subprocess.run(command, check=True)
    for target in targets:
        first, second = (
            {path.name: path.read_bytes() for path in (tmp_path / folder / target).iterdir()}
            for folder in ("with", "without")
        )
        assert first == second
        assert first


def test_choices_of_a_kernel_at_hand_and_in_the_cache_are_equal(file):
    derived, stored = (choose(file) for _ in range(2))
    assert derived == stored
    assert derived.identity == stored.identity
    assert hash(derived) == hash(stored)
    assert pickle.loads(pickle.dumps(stored)) == derived
    assert stored.user_kernel.kernel == derived.user_kernel.kernel


def test_a_kernel_that_no_longer_restores_is_derived_again(file, monkeypatch):
    derived = choose(file).user_kernel.kernel
    stored = choose(file)
    monkeypatch.setattr(loading.pickle, "loads", lambda data: 1 / 0)
    assert stored.user_kernel.kernel == derived
