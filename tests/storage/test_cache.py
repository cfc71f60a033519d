"""The cache: an entry is whole or absent, whoever fails and whoever is first."""

from __future__ import annotations

import ctypes
import dataclasses
import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
import sympy

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.exceptions import CompilerError, InputError
from strapgen.run import compiler
from strapgen.storage import cache, drafts, ownership


@pytest.fixture(autouse=True)
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Point the cache to an empty folder."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(folder))
    return folder


def write(name: str, text: str = "x"):
    return lambda draft: (draft / name).write_text(text)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def never(_: Path) -> None:
    raise AssertionError("filled again")


@pytest.mark.posix
def test_folder_is_chosen_by_the_environment(root, tmp_path, monkeypatch):
    assert cache.root() == root
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", "here")
    assert cache.root() == tmp_path / "here", "a change of folder must not move it"
    monkeypatch.delenv("STRAPGEN_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache.root() == tmp_path / "xdg" / "strapgen"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache.root() == tmp_path / "home" / ".cache" / "strapgen"


def test_digest_tells_where_texts_end():
    assert cache.digest(["ab", "c"]) != cache.digest(["a", "bc"])
    assert cache.digest(["a"]) != cache.digest(["a", ""])
    assert cache.digest(["σ"]) == cache.digest(["σ".encode()])


def test_entry_is_filled_once(root):
    place = cache.entry("kind", "key", write("file", "content"))
    assert place == root / "kind" / "key"
    assert cache.entry("kind", "key", never) == place
    assert (place / "file").read_text() == "content"
    assert names(root / "kind") == ["key"]


@pytest.mark.parametrize("error", [CompilerError("refused"), KeyboardInterrupt(), ZeroDivisionError()])
def test_failing_fill_leaves_nothing(root, error):
    def fill(draft: Path) -> None:
        write("half")(draft)
        raise error

    with pytest.raises(type(error)):
        cache.entry("kind", "key", fill)
    assert names(root / "kind") == []
    cache.entry("kind", "key", write("file"))
    assert names(root / "kind" / "key") == ["file", "manifest.json"]


def test_full_disk_is_reported(root):
    def fill(draft: Path) -> None:
        write("half")(draft)
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match=r"^cache folder .* cannot be written \(No space left on device\)$"):
        cache.entry("kind", "key", fill)
    assert names(root / "kind") == []


def test_an_entry_is_the_folder_that_was_filled_and_appears_at_once(root):
    filled = []

    def fill(draft: Path) -> None:
        write("file")(draft)
        assert not (root / "kind" / "key").exists()
        filled.append(draft.stat().st_ino)

    assert [cache.entry("kind", "key", fill).stat().st_ino] == filled, "a copy would be seen half-made"


def test_first_of_two_wins(root):
    def fill(draft: Path) -> None:
        cache.entry("kind", "key", write("file", "first"))  # another process, in the meantime
        write("file", "second")(draft)

    place = cache.entry("kind", "key", fill)
    assert (place / "file").read_text() == "first"
    assert names(root / "kind") == ["key"]


@pytest.mark.posix
def test_draft_of_a_killed_process_is_never_read(root):
    (root / "kind").mkdir(parents=True)
    killed = root / "kind" / ".filling-01234567"
    with drafts.draft_folder(root / "kind", ".filling-") as at_work:
        killed.mkdir()
        write("file", "half")(killed)
        place = cache.entry("kind", "key", write("file", "whole"))
        assert (place / "file").read_text() == "whole"
        assert at_work.is_dir()
    assert names(root / "kind") == ["key"]


@pytest.mark.posix
def test_draft_of_a_killed_process_is_removed_though_another_one_made_the_entry(root):
    place = cache.entry("kind", "key", write("file"))
    killed = root / "kind" / ".filling-01234567"
    killed.mkdir()
    cache._tidied.clear()  # as in a new process
    assert cache.entry("kind", "key", never) == place
    assert names(root / "kind") == ["key"]


def test_entries_of_long_ago_are_removed(root):
    old = cache.entry("kind", "old", write("file"))
    recent = cache.entry("kind", "recent", write("file"))
    for place, days in ((old, 100), (recent, 10)):
        then = time.time() - days * 86400
        os.utime(place, (then, then))
    cache.entry("kind", "new", write("file"))
    assert names(root / "kind") == ["new", "recent"]


def test_entry_that_appears_meanwhile_is_kept(root, monkeypatch):
    """Another process puts its entry in place just after this one has looked for it."""
    looks = []
    is_whole = cache._is_whole

    def look(place: Path) -> bool:
        found = is_whole(place)
        looks.append(found)
        if len(looks) == 1:
            assert not found
            cache.entry("kind", "key", write("file", "theirs"))
        return found

    monkeypatch.setattr(cache, "_is_whole", look)
    place = cache.entry("kind", "key", write("file", "ours"))
    assert (place / "file").read_text() == "theirs"


@pytest.mark.parametrize("place", ["file/cache", pytest.param("/proc/strapgen", marks=pytest.mark.posix)])
def test_folder_that_cannot_be_written(place, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("x")
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(tmp_path / place))
    with pytest.raises(
        InputError, match=r"^cache folder .* cannot be written .*; set STRAPGEN_CACHE_DIR to one"
    ):
        cache.entry("kind", "key", never)


# What is kept there


def test_generator_digest_sees_every_template(monkeypatch, tmp_path):
    from strapgen.storage import resources

    files = resources.package_files()
    assert {path.name for path in files} >= {"printer.py", "runge_kutta.py", "source.c.j2", "module.py.j2"}
    changed = tmp_path / "source.c.j2"
    template = next(path for path in files if path.name == changed.name)
    changed.write_bytes(template.read_bytes() + b"\n")
    before = cache.generator_digest.__wrapped__()
    monkeypatch.setattr(resources, "package_files", lambda: [changed if p == template else p for p in files])
    assert cache.generator_digest.__wrapped__() != before


BUILD = """
import json, sys
import strapgen
print("ready", flush=True)
sys.stdin.readline()
backend = strapgen.backend("euler", "rk1", 1, backend="c")
print(json.dumps(backend.propagate([[[0.1, 0.2, 0.3]]] * 5, orthonormalize_every=2).tolist()))
"""


@pytest.mark.long
def test_processes_may_build_the_same_at_once(root):
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", BUILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    for process in processes:
        assert process.stdout.readline() == "ready\n"
    for process in processes:  # all together
        process.stdin.write("go\n")
        process.stdin.flush()
    results = [process.communicate(timeout=120) for process in processes]
    assert [process.returncode for process in processes] == [0] * 2, results
    assert len({out for out, _ in results}) == 1
    assert len(json.loads(results[0][0])) == 6
    # The step and the normalization, and of each its program, its sources and its build.
    assert {kind: len(names(root / kind)) for kind in names(root)} == {
        "programs": 2,
        "sources": 2,
        "builds": 2,
    }
    for place in (root / "builds").iterdir():
        assert len([path for path in place.iterdir() if path.name != "manifest.json"]) == 1


def empty(place: Path) -> None:
    for path in place.iterdir():
        path.unlink()


DAMAGE = {
    "emptied": empty,
    "removed": lambda place: (place / "file").unlink(),
    "cut": lambda place: (place / "file").write_text(""),
    "changed": lambda place: (place / "file").write_text("something else"),
    "more": lambda place: (place / "stranger").write_text("not ours"),
    "unlisted": lambda place: (place / "manifest.json").unlink(),
    "garbled": lambda place: (place / "manifest.json").write_text("{"),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_entry_is_made_again(root, damage):
    place = cache.entry("kind", "key", write("file"))
    whole = {path.name: path.read_bytes() for path in place.iterdir()}
    damage(place)
    assert cache.entry("kind", "key", write("file")) == place
    assert {path.name: path.read_bytes() for path in place.iterdir()} == whole


def test_a_file_in_the_place_of_an_entry_gives_way(root):
    place = cache.entry("kind", "key", write("file"))
    empty(place)
    place.rmdir()
    place.write_text("a file")
    assert names(cache.entry("kind", "key", write("file"))) == ["file", "manifest.json"]


def test_an_entry_in_use_is_not_pruned(root):
    place = cache.entry("kind", "old", write("file"))
    long_ago = 1_000_000_000
    os.utime(place, (long_ago, long_ago))
    cache.entry("kind", "old", write("file"))
    cache.entry("kind", "new", write("file"))
    assert "old" in names(root / "kind")
    os.utime(place, (long_ago, long_ago))
    cache.entry("kind", "newer", write("file"))
    assert "old" not in names(root / "kind")


@pytest.mark.posix
def test_missing_home_folder_names_the_variable(monkeypatch):
    def unknown(_user):
        raise KeyError

    for name in ("STRAPGEN_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", unknown)
    with pytest.raises(InputError, match=r"^no home folder .* set STRAPGEN_CACHE_DIR"):
        cache.root()


@pytest.mark.posix
def test_the_home_folder_may_be_written_as_a_tilde(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", "~/kept")
    assert cache.root() == tmp_path / "kept"


@pytest.mark.parametrize("times", [4, 5])
def test_work_whose_entry_another_process_removes_begins_again(root, times):
    """The clock of the other one may be wrong, so that every entry is of long ago."""
    left = [times]

    def work() -> bytes:
        place = cache.entry("kind", "key", write("file", "content"))
        if left[0]:
            left[0] -= 1
            shutil.rmtree(place)
        return cache.read(place, "file")

    if times < 5:
        assert cache.persistently(work) == b"content"
    else:
        with pytest.raises(FileNotFoundError):
            cache.persistently(work)


@pytest.mark.parametrize("times", [4, 5])
def test_an_entry_that_another_process_removes_at_once_is_made_again(root, times, monkeypatch):
    left, is_whole = [times], cache._is_whole

    def look(place: Path) -> bool:
        if left[0] and place.is_dir():
            left[0] -= 1
            shutil.rmtree(place)
        return is_whole(place)

    monkeypatch.setattr(cache, "_is_whole", look)
    if times < 5:
        assert (cache.entry("kind", "key", write("file")) / "file").is_file()
    else:
        with pytest.raises(InputError, match=r"^cache entry .* cannot be made; remove it$"):
            cache.entry("kind", "key", write("file"))


@pytest.mark.parametrize("kind", ["programs", "sources", "builds"])
def test_entries_removed_during_a_read_are_made_again(kind, root, monkeypatch):
    for name in ("_loaded", "_modules"):
        monkeypatch.setattr(compiler, name, {})
    monkeypatch.setattr(cache, "_results", {})
    looked_up, removed = cache.lookup, []

    def lookup(of_kind: str, key: str) -> Path | None:
        place = looked_up(of_kind, key)
        if place is not None and of_kind == kind and not removed:
            shutil.rmtree(place)
            removed.append(place)
        return place

    compiler.load(pipeline.compile(choose("euler-product"), "c"))
    monkeypatch.setattr(cache, "_results", {})
    for name in ("_loaded", "_modules"):
        monkeypatch.setattr(compiler, name, {})
    monkeypatch.setattr(cache, "lookup", lookup)
    pipeline.program(choose("euler-product"))
    assert compiler.load(pipeline.compile(choose("euler-product"), "c")).lib.euler_product
    assert len(removed) == 1


# Results of work


@pytest.fixture
def doubled():
    """A function whose results are stored, and the arguments for which they were worked out."""
    calls = []

    def double(number: int, extra: tuple[str, ...] = ()) -> tuple[int, None]:
        def work() -> tuple[int, None]:
            calls.append(number)
            if number < 0:
                raise OSError(2, "no such number")
            return 2 * number, None

        return cache.stored("results", [str(number), *extra], work, f"2 x {number}")

    return double, calls


def test_result_is_computed_once_for_each_key(doubled, root, caplog):
    double, calls = doubled
    caplog.set_level("INFO", "strapgen")
    assert [double(3), double(3), double(4), double(3, ("x",))] == [
        (6, None),
        (6, None),
        (8, None),
        (6, None),
    ]
    assert calls == [3, 4, 3]
    assert caplog.messages == ["2 x 3: from the cache"]
    assert len(names(root / "results")) == 3


def test_an_error_of_the_work_is_its_own_and_leaves_no_result(doubled, root):
    double, calls = doubled
    for _ in range(2):
        with pytest.raises(FileNotFoundError, match="no such number"):
            double(-1)
    assert calls == [-1, -1] and not root.exists()


# Who may write there


@pytest.fixture
def warnings(caplog, monkeypatch) -> pytest.LogCaptureFixture:
    """The warnings of a process that has given none yet."""
    cache._warn.cache_clear()
    monkeypatch.setattr(cache, "_replaced", {})
    caplog.set_level("WARNING", "strapgen")
    return caplog


def to_stranger(*paths: Path) -> None:
    """Give files to another user, or at least let others write them."""
    for path in paths:
        if os.geteuid() == 0:
            os.chown(path, 65534, -1)
        else:
            path.chmod(path.stat().st_mode | 0o022)


def planted(place: Path, files: dict[str, str]) -> list[Path]:
    """Write an entry that is whole by all that its manifest says, as anybody can; return its files."""
    place.mkdir(parents=True)
    for name, text in files.items():
        (place / name).write_text(text)
    (place / "manifest.json").write_text(json.dumps(cache._hashes(place)))
    return list(place.iterdir())


WRONG = {
    "file": lambda place: (place / "file",),
    "manifest": lambda place: (place / "manifest.json",),
    "entry": lambda place: (place,),
    "kind": lambda place: (place.parent,),
    "all of it": lambda place: (*place.iterdir(), place, place.parent),
}


@pytest.mark.posix
@pytest.mark.parametrize("which", WRONG.values(), ids=WRONG)
def test_an_entry_that_others_could_have_changed_is_made_again(root, which, warnings):
    root.mkdir()
    place = root / "kind" / "key"
    planted(place, {"file": "theirs"})
    to_stranger(*which(place))
    assert cache.lookup("kind", "key") is None
    assert cache.entry("kind", "key", write("file", "ours")) == place
    assert cache.read(place, "file") == b"ours"
    assert names(root / "kind") == ["key"]
    assert len(warnings.messages) == 1 and "it is not used, and made again" in warnings.messages[0]
    cache.entry("kind", "key", never)


@pytest.mark.posix
@pytest.mark.parametrize("above", [False, True])
def test_a_cache_folder_that_others_write_is_not_used(root, above, warnings):
    place = root / "kind" / "key"
    planted(place, {"file": "theirs"})
    changed = root.parent if above else root
    changed.chmod(0o777)
    assert cache.lookup("kind", "key") is None
    entry = cache.entry("kind", "key", write("file", "ours"))
    assert not entry.is_relative_to(root)
    assert cache.read(entry, "file") == b"ours"
    assert cache.entry("kind", "key", never) == entry
    assert entry.parents[1].stat().st_mode & 0o777 == 0o700
    assert warnings.messages == [
        f"strapgen: cache folder {root} is not used, since {changed} can be written by other users; "
        "what is generated lasts until the program ends"
    ]


@pytest.mark.posix
def test_neither_folder_of_the_user_is_refused_in_one_line(root, tmp_path, monkeypatch, warnings):
    root.mkdir()
    (tmp_path / "tmp").mkdir()
    for folder in (root, tmp_path / "tmp"):
        folder.chmod(0o777)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    with pytest.raises(
        InputError, match=r"^cache folder .* is not used, since .*; nor is a temporary one \(.*\)$"
    ):
        cache.entry("kind", "key", never)
    assert names(tmp_path / "tmp") == []


AT_EXIT = """
import os, sys
from strapgen.storage import cache
place = cache.entry("kind", "key", lambda draft: (draft / "file").write_text("x"))
if os.fork() == 0:
    raise SystemExit(0 if cache.entry("kind", "key", None) == place else 1)
assert os.wait()[1] == 0
assert (place / "file").exists(), "another process still uses it"
print(place, flush=True)
if sys.argv[1] == "killed":
    os.kill(os.getpid(), 9)
"""


@pytest.mark.posix
def test_a_temporary_folder_is_gone_when_the_program_ends_or_the_next_one_runs(root, tmp_path, monkeypatch):
    root.mkdir()
    root.chmod(0o777)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))

    def run(how: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", AT_EXIT, how], capture_output=True, text=True, check=False
        )

    killed = run("killed")
    assert Path(killed.stdout.strip()).is_dir()
    ended = run("ended")
    assert ended.returncode == 0 and ended.stderr.count("\n") == 1, ended.stderr
    assert names(tmp_path / "tmp") == []


@pytest.mark.posix
@pytest.mark.parametrize("umask", [0o000, 0o002, 0o077])
def test_created_folders_are_private_under_any_umask(root, umask, monkeypatch, warnings):
    monkeypatch.setenv("STRAPGEN_CACHE_DIR", str(root / "deep" / "er"))
    before = os.umask(umask)
    try:
        place = cache.entry("kind", "key", write("file"))
    finally:
        os.umask(before)
    made = [place, *place.parents[:4], *place.iterdir()]
    assert root in made
    assert not any(path.stat().st_mode & 0o022 for path in made)
    assert cache.lookup("kind", "key") == place and not warnings.messages


@pytest.mark.posix
def test_planted_python_does_not_run(root, tmp_path, warnings, monkeypatch):
    """Generated text is executed as it is: a manifest that is right proves nothing."""
    sources = pipeline.compile(choose("euler-product"), "numpy")
    (entry,) = (root / "sources").iterdir()
    (name,) = sources.files
    marker = tmp_path / "ran"
    planted = dataclasses.replace(sources, files={name: f"open({str(marker)!r}, 'w')\n{sources.files[name]}"})
    (entry / "result.pickle").write_bytes(pickle.dumps(planted))
    (entry / "manifest.json").write_text(json.dumps(cache._hashes(entry)))
    to_stranger(*entry.iterdir(), entry)
    monkeypatch.setattr(cache, "_results", {})  # as another process
    again = pipeline.compile(choose("euler-product"), "numpy")
    compiler._import_text(again)
    assert not marker.exists() and again == sources
    assert len(warnings.messages) == 1


PLANTED = (
    '#include <stdio.h>\n__attribute__((constructor)) static void ran(void) {{ fclose(fopen("{}", "w")); }}\n'
)


@pytest.mark.posix
@pytest.mark.parametrize("when", ["before", "after the check"])
def test_a_planted_library_is_not_loaded(root, tmp_path, when, monkeypatch, warnings):
    sources = pipeline.compile(choose("euler-product"), "c")
    monkeypatch.setattr(compiler, "_loaded", {})
    monkeypatch.setattr(compiler, "_modules", {})
    compiler.load(sources)
    (entry,) = (root / "builds").iterdir()
    library = next(path for path in entry.iterdir() if path.name != "manifest.json")
    marker = tmp_path / "ran"
    (tmp_path / "planted.c").write_text(PLANTED.format(marker))
    planted_library = tmp_path / "planted.so"
    command = [compiler.C.path(), "-shared", "-fPIC", "-o", planted_library, tmp_path / "planted.c"]
    subprocess.run(command, check=True)
    assert not marker.exists()

    def plant() -> None:
        library.unlink()
        library.write_bytes(planted_library.read_bytes())
        (entry / "manifest.json").write_text(json.dumps(cache._hashes(entry)))

    if when == "before":
        plant()
        to_stranger(*entry.iterdir(), entry)
    else:
        path_of = ownership.path_of

        def late(descriptor: int, place: Path) -> str:
            if "/builds/" in str(place):
                plant()
            return path_of(descriptor, place)

        monkeypatch.setattr(ownership, "path_of", late)
    monkeypatch.setattr(compiler, "_loaded", {})
    monkeypatch.setattr(compiler, "_modules", {})
    module = compiler.load(sources)
    assert not marker.exists()
    assert module.lib.euler_product
    assert len(warnings.messages) == (when == "before")
    ctypes.CDLL(str(planted_library))
    assert marker.exists(), "the planted library does what was looked for"


def test_generator_digest_sees_the_version_of_sympy(monkeypatch, tmp_path):
    before = cache._release_of_sympy()
    assert sympy.__version__.encode() in before
    other = tmp_path / "sympy"
    other.mkdir()
    (other / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    assert cache._release_of_sympy() == sympy.__version__.encode()  # of a package that has no such file
    (other / "release.py").write_text('__version__ = "99"\n')
    assert cache._release_of_sympy() == b'__version__ = "99"\n'
