"""Studies whose results stay in a file: side by side, killed, resumed, and never mixed with those of another study."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from strapgen.ir.exceptions import InputError, StrapgenError
from strapgen.lab.parallel_cases import resume, side_by_side

CASES = {f"case {k}": k for k in range(7)}
IDENTITY = {"version": "1", "rate": 100}


def square(number: int) -> int:
    return number * number


def refuse_3(number: int) -> int:
    if number == 3:
        raise InputError("3 is not allowed")
    return number


def end_at_once(number: int) -> int:
    os._exit(1)


def never(number: int) -> int:
    raise AssertionError("a result that is there is not worked out again")


@pytest.mark.parametrize("jobs", [1, 2])
def test_cases_run_whatever_the_number_of_processes(jobs):
    assert dict(side_by_side(square, CASES, jobs)) == {name: k * k for name, k in CASES.items()}


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_a_case_raises_is_raised_and_what_is_done_stays(jobs, tmp_path):
    path = tmp_path / "results.jsonl"
    with pytest.raises(InputError, match="3 is not allowed"):
        list(resume(refuse_3, CASES, path, IDENTITY, jobs))
    kept = [json.loads(line)["case"] for line in path.read_text().splitlines()[1:]]
    assert {*kept} <= {*CASES} - {"case 3"}
    if jobs == 1:
        assert kept == ["case 0", "case 1", "case 2"]


def test_a_process_that_is_killed_is_told_in_one_line():
    with pytest.raises(StrapgenError, match="a process of the study was killed"):
        list(side_by_side(end_at_once, CASES, 2))


def test_results_are_read_again_and_not_worked_out(tmp_path):
    path = tmp_path / "results.jsonl"
    first = dict(resume(square, CASES, path, IDENTITY, 1))
    content = path.read_bytes()
    assert list(resume(never, CASES, path, IDENTITY, 2)) == list(first.items())
    assert path.read_bytes() == content
    # Some of the cases, or others beside them, belong to the same study.
    assert dict(resume(never, {"case 2": 2}, path, IDENTITY)) == {"case 2": 4}
    assert dict(resume(square, {"new": 9, "case 2": 2}, path, IDENTITY, 1)) == {"case 2": 4, "new": 81}


def test_a_result_is_the_same_when_it_is_read_again(tmp_path):
    values = {"tuple": (1, 2), "number": 0.1, "none": None}
    path = tmp_path / "results.jsonl"
    first = dict(resume(dict, {"one": values}, path, IDENTITY))
    assert first == dict(resume(never, {"one": values}, path, IDENTITY))
    assert first["one"] == {"tuple": [1, 2], "number": 0.1, "none": None}


@pytest.mark.parametrize("end", [-1, -5, -20, -30, -50, -10_000, 1, 10, 30])
def test_a_file_that_ends_anywhere_goes_on_from_its_last_complete_line(end, tmp_path):
    path = tmp_path / "results.jsonl"
    whole = dict(resume(square, CASES, path, IDENTITY, 1))
    content = path.read_bytes()
    path.write_bytes(content[:end])
    assert dict(resume(square, CASES, path, IDENTITY, 1)) == whole
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("identity", "words"),
    [
        ({"version": "2", "rate": 100}, 'holds another study: version is "1" there and "2" here'),
        ({"version": "1", "rate": 200}, "holds another study: rate is 100 there and 200 here"),
        ({"version": "1"}, "holds another study: rate is 100 there and null here"),
        (
            {**IDENTITY, "band": list(range(99))},
            r"holds another study: band is null there and \[0, 1, 2.*\.\.\. here",
        ),
    ],
)
def test_the_results_of_another_study_are_refused_and_left_alone(identity, words, tmp_path):
    path = tmp_path / "results.jsonl"
    list(resume(square, CASES, path, IDENTITY, 1))
    torn = path.read_bytes()[:-3]
    path.write_bytes(torn)
    with pytest.raises(InputError, match=words) as refusal:
        list(resume(square, CASES, path, identity, 1))
    assert "\n" not in str(refusal.value)
    assert path.read_bytes() == torn


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"hello", "holds no results of a study"),
        (b"hello\n", "holds no results of a study"),
        (b"[1, 2]\n", "holds no results of a study"),
        (b'{"study": 3}\n', "holds no results of a study"),
        (b"[" * 100_000 + b"\n", "holds no results of a study"),
        (
            b'{"study": {"version": "1", "rate": 100}}\n{"case": 3, "result": 1}\n',
            "line 2 of .* is no result",
        ),
        (b'{"study": {"version": "1", "rate": 100}}\n\xff\n', "line 2 of .* is no result"),
    ],
)
def test_other_files_are_refused_and_left_alone(content, words, tmp_path):
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        list(resume(square, CASES, path, IDENTITY, 1))
    assert path.read_bytes() == content


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path, tmp_path / "file" / "results.jsonl"):
        with pytest.raises(InputError, match="cannot be written"):
            list(resume(square, CASES, path, IDENTITY, 1))
    with pytest.raises(InputError, match="/dev/null is no ordinary file"):
        list(resume(square, CASES, "/dev/null", IDENTITY, 1))


STUDY = """
import sys, time
from pathlib import Path
from strapgen.lab.parallel_cases import resume

def wait(number):
    # The first cases come at once; the others wait for a file that the test writes after it has killed this process.
    while number >= 3 and not Path(sys.argv[2]).exists():
        time.sleep(0.01)
    return number

if __name__ == "__main__":
    for name, result in resume(wait, {str(k): k for k in range(6)}, sys.argv[1], {"version": "1"}, 2):
        print(name, flush=True)
"""


def test_a_study_that_is_killed_goes_on_where_it_was(tmp_path):
    script, path, go = tmp_path / "study.py", tmp_path / "results.jsonl", tmp_path / "go"
    script.write_text(STUDY)
    command = [sys.executable, str(script), str(path), str(go)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    before = {process.stdout.readline().strip() for _ in range(3)}
    # While it runs, nobody else writes the file.
    second = subprocess.run(command, capture_output=True, text=True)
    assert "is being written by another process" in second.stderr.splitlines()[-1]
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    process.stdout.close()
    assert before == {"0", "1", "2"}
    lines = path.read_bytes().splitlines()
    assert [json.loads(line)["case"] for line in lines[1:]] and len(lines) == 4
    with path.open("ab") as file:  # as if it had been killed while it wrote
        file.write(b'{"case": "4", "resu')
    go.touch()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert sorted(done.stdout.split()) == [str(k) for k in range(6)]
    assert path.read_bytes().splitlines()[:4] == lines
    results = dict(json.loads(line).values() for line in path.read_bytes().splitlines()[1:])
    assert results == {str(k): k for k in range(6)}


def test_no_process_is_left_behind(tmp_path):
    """The workers of a study that was killed end by themselves."""
    script, path, go = tmp_path / "study.py", tmp_path / "results.jsonl", tmp_path / "go"
    script.write_text(STUDY)
    process = subprocess.Popen(
        [sys.executable, str(script), str(path), str(go)], stdout=subprocess.PIPE, text=True
    )
    for _ in range(3):
        process.stdout.readline()
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    # The pipe ends when the last process that holds it does.
    assert process.stdout.read() == ""
    process.stdout.close()


def test_folders_are_made_for_the_file(tmp_path):
    path = tmp_path / "out" / "deep" / "results.jsonl"
    list(resume(square, CASES, path, IDENTITY, 1))
    assert len(path.read_text().splitlines()) == 1 + len(CASES)


def test_the_file_can_be_read_while_the_study_runs(tmp_path):
    path = Path(tmp_path / "results.jsonl")
    study = resume(square, CASES, path, IDENTITY, 1)
    next(study)
    next(study)
    assert len(path.read_text().splitlines()) == 3
    study.close()
    assert dict(resume(square, CASES, path, IDENTITY, 1)).keys() == CASES.keys()
