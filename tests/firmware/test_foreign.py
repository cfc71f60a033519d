"""A user's function in C: it is called as its file says, and what it does wrong stays in a process of its own."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from strapgen.cli import main
from strapgen.firmware.check_code import foreign
from strapgen.firmware.check_code.bridge import read_source
from strapgen.firmware.check_code.foreign import ForeignStep, Segment, compile_foreign, run_foreign
from strapgen.firmware.check_code.foreign_arguments import is_foreign, read_arguments
from strapgen.ir.exceptions import CompilerError, InputError

#: Functions that write what they are called with, or do what they must not.
CALLS = """
#include <stdlib.h>
#include <stdio.h>
static double calls;
void begin(void) { calls = 0; }
void look(const double q[4], const double p[1][3], const double d[2][3], double dt, double step, double out[4])
{
    calls += 1;
    printf("a function may print\\n");
    out[0] = q[0] + calls; out[1] = p[0][0] + 10 * d[1][2]; out[2] = dt; out[3] = step;
}
void beyond(double q[4], const double d[3])
{
    if (d[0] == 1) q[4] = 1;
    if (d[0] == 2) ((double *)d)[1] = 7;
    if (d[0] == 3) abort();
    if (d[0] == 4) exit(5);
    while (d[0] == 5) ((volatile double *)q)[0] = 1;
}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "calls.c").write_text(CALLS)
    return tmp_path / "calls.c"


@pytest.mark.long
def test_a_function_gets_every_argument_and_a_run_begins_where_it_says(file):
    arguments = "state[4], previous[1][3], increments[2][3], dt, step -> next[4]"
    module = compile_foreign(read_source(file, "look", arguments, "begin"))
    row = [0.5, 1.0, 7.0, 0, 0, *range(6)]
    run = run_foreign(module, [100, 0, 0, 0], [[1, *row], [0, *row], [1, *row]])
    assert not (run.stopped or run.writes_beyond or run.changes_inputs)
    np.testing.assert_array_equal(
        run.outputs[:, 0], [101, 103, 101]
    )  # the second call takes the state of the first
    np.testing.assert_array_equal(run.outputs[:, 1:], np.tile([57, 0.5, 1], (3, 1)))
    assert compile_foreign(read_source(file, "look", arguments, "begin")) == module  # from the cache


#: A function that looks at what it gets beside the samples of a gyro.
BESIDE = """
typedef struct { double q[4]; double v[3]; } nav_t;
void put(nav_t *nav, const double d[3], const double f[3], const double g[3], const double w[3], double dt)
{
    for (int i = 0; i < 3; i++) { nav->q[i] = d[i]; nav->v[i] += f[i] * dt + g[i]; }
    nav->q[3] = w[0];
}
void look(double q[4], const double d[2][3], const double s[2][3], double v[3], const double p[3], double p_next[3])
{
    for (int i = 0; i < 3; i++) { v[i] += s[1][i]; p_next[i] = p[i] + 10 * v[i]; }
    q[0] = d[0][0];
}
void change(const double d[3], const double s[3], double change[3])
{
    for (int i = 0; i < 2; i++) change[i] = d[i] + s[i];
}
"""
PUT = "nav_t *nav, increments[3], forces[3], gravity[3], frame_rate[3], dt -> nav.q[4], velocity = nav.v[3]"
CHANGE = "increments[3], velocity_increments[3] -> velocity_change[3]"
LOOK = (
    "state[4], increments[2][3], velocity_increments[2][3], velocity[3], position[3] "
    "-> state[4], velocity[3], next_position[3]"
)


def test_a_function_gets_specific_force_gravity_and_the_rate_of_the_frame(tmp_path):
    (tmp_path / "a.c").write_text(BESIDE)
    rates, pushes = np.full((2, 1, 3), 0.01), np.array([[[1.0, 2, 3]], [[4, 5, 6]]])

    def run(function: str, arguments: str, segment: Segment, **more):
        source = read_source(tmp_path / "a.c", function, arguments)
        (done,) = ForeignStep(source, **more).run([segment]).segments
        return done

    done = run(
        "put",
        PUT,
        Segment(rates, settled=False, velocities=pushes),
        gravity=(0, 0, -9.0),
        frame_rate=(0.5, 0, 0),
    )
    np.testing.assert_array_equal(done.states, [[0.01, 0.01, 0.01, 0.5]] * 2)
    expected = [[0, 0, 0], [1, 2, -6], [5, 7, -9]]
    np.testing.assert_allclose(done.translations["velocity"], expected, atol=1e-13)
    rates, pushes = np.tile(rates, (1, 2, 1)), np.tile(pushes, (1, 2, 1))
    done = run("look", LOOK, Segment(rates, velocities=pushes))
    expected = [[0, 0, 0], [1, 2, 3], [5, 7, 9]]
    np.testing.assert_array_equal(done.translations["velocity"], expected)
    np.testing.assert_array_equal(done.translations["position"], 10 * np.cumsum(expected, axis=0))
    source = read_source(tmp_path / "a.c", "change", CHANGE)
    done = ForeignStep(source).run([Segment(rates[:, :1])])  # the third number is never written
    assert done.stopped.startswith("it leaves no finite numbers")


def test_faults_of_a_function_are_named(file, monkeypatch):
    module = compile_foreign(read_source(file, "beyond", "state[4], increments[3] -> state[4]"))

    def run(number: float):
        return run_foreign(module, [0, 0, 0, 1], [[1, 1, 1, number, 0, 0]])

    for number, beyond, changes in ((0, False, False), (1, True, False), (2, False, True)):
        done = run(number)
        assert (done.writes_beyond, done.changes_inputs, done.stopped) == (beyond, changes, "")
    assert run(3).stopped == "it ends with SIGABRT"
    assert run(4).stopped == "it ends the program, with exit status 5"
    monkeypatch.setattr(foreign, "PATIENCE", 0.3)
    endless = run(5)
    assert endless.stopped == "1 calls have not come to an end in 0.3 s" and len(endless.outputs) == 0


IN_PLACE = "state[4], increments[3] -> state[4]"


@pytest.mark.parametrize(
    ("function", "init", "arguments", "precision", "says"),
    [
        ("lok", "", IN_PLACE, "double", r"has no function lok \(did you mean look\?\); it has begin, look"),
        (
            "beyond",
            "",
            IN_PLACE,
            "float",
            "in --precision float: .const double d.3.. is double",
        ),
        pytest.param(
            *(
                "beyond",
                "",
                "dt, increments[3] -> next[4]",
                "double",
                "dt is .double q.4..; one number is needed",
            ),
            marks=pytest.mark.long,
        ),
        pytest.param(
            *("beyond", "start", IN_PLACE, "double", "--init: .* has no function start"),
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_call_that_does_not_fit_is_refused(file, function, init, arguments, precision, says):
    with pytest.raises((CompilerError, InputError), match=says) as caught:
        compile_foreign(read_source(file, function, arguments, init, precision))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('#include "none.h"', r"faulty\.c:1:\d+: fatal error: .*none\.h"),
        (
            "void f(double q[4], const double d[3]) {\n    q[0] = d[0]\n}\n",
            r"faulty\.c:2:\d+: error: expected",
        ),
    ],
)
def test_a_file_that_does_not_compile_gives_its_first_error(tmp_path, monkeypatch, text, says):
    monkeypatch.chdir(tmp_path)
    Path("faulty.c").write_text(text)
    with pytest.raises(CompilerError, match=rf"^faulty\.c does not compile: {says}"):
        compile_foreign(read_source(Path("faulty.c"), "f", "state[4], increments[3] -> state[4]"))


def test_names_and_files_are_looked_at_before_anything_is_compiled(file, tmp_path):
    arguments = "state[4], increments[3] -> state[4]"
    (tmp_path / "a.m").write_text("")
    with pytest.raises(
        InputError, match=r"a\.m is no file in C or C\+\+ by its suffix; allowed: \.c, \.h, \.cc"
    ):
        read_source(tmp_path / "a.m", "f", arguments)
    with pytest.raises(InputError, match="is no file"):
        read_source(tmp_path / "none.c", "f", arguments)
    with pytest.raises(InputError, match="--function is 'f:'; the name of a function is needed"):
        read_source(file, "f:", arguments)
    with pytest.raises(InputError, match="--init is 'a b'"):
        read_source(file, "f", arguments, "a b")
    with pytest.raises(InputError, match="precision 'half' is not known; allowed: double, float"):
        read_source(file, "f", arguments, "", "half")


def test_a_function_that_is_defined_nowhere_is_named(tmp_path):
    (tmp_path / "a.c").write_text(
        "void other(double *q);\nvoid f(double q[4], const double d[3]) { other(q); }\n"
    )
    module = compile_foreign(read_source(tmp_path / "a.c", "f", IN_PLACE))
    with pytest.raises(
        CompilerError, match=r"cannot be linked: undefined symbol: other; include the file"
    ) as caught:
        run_foreign(module, [0, 0, 0, 1], [[1, 1, 1, 0, 0, 0]])
    assert "\n" not in str(caught.value)


@pytest.mark.long
def test_init_function_gets_its_arguments(tmp_path):
    (tmp_path / "a.c").write_text(
        "typedef struct { double q[4]; } memory_t;\n"
        "void of_state(double q[4]) { q[1] = 5; }\n"
        "void of_memory(memory_t *m) { m->q[1] = 7; }\n"
        "void of_both(memory_t *m, double q[4]) { m->q[1] = q[1]; }\n"
        "void step(double q[4], const double d[3]) { q[2] += d[0]; }\n"
        "void put(memory_t *m, const double d[3]) { m->q[2] += d[0]; }\n"
    )
    memory = "memory_t *of_memory, increments[3] -> of_memory.q[4]"  # a name that the file has too
    for function, arguments, init, second in (
        ("step", IN_PLACE, "of_state", 5),
        ("put", memory, "of_memory", 7),
        ("put", memory, "", 0),
    ):
        source = read_source(tmp_path / "a.c", function, arguments, init)
        run = run_foreign(compile_foreign(source), [0, 0, 0, 1], [[1, 1, 1, 2, 0, 0], [0, 1, 1, 3, 0, 0]])
        np.testing.assert_array_equal(run.outputs[:, 1:3], [[second, 2], [second, 5]])
    with pytest.raises(
        InputError, match=r"of_both of --init does not take the memory, the state or nothing: `double q\[4\]`"
    ):
        compile_foreign(read_source(tmp_path / "a.c", "put", memory, "of_both"))


@pytest.mark.long
@pytest.mark.needs("g++")
def test_an_adapter_calls_a_class_and_the_compiler_takes_options(tmp_path, monkeypatch):
    (tmp_path / "include").mkdir()
    (tmp_path / "include" / "vector.hpp").write_text("struct Vector { double x, y, z; };\n")
    (tmp_path / "integrator.hpp").write_text(
        "#include <vector.hpp>\nclass Integrator {\n  double sum = 0;\npublic:\n"
        "  double put(Vector d) { return sum += d.x + 2 * d.y + 3 * d.z; }\n};\n"
    )
    (tmp_path / "adapter.cc").write_text(
        '#include "integrator.hpp"\nstatic Integrator integrator;\n'
        "void begin() { integrator = Integrator(); }\n"
        "void put(const double d[3], double next[4])\n"
        "{\n    next[0] = next[1] = next[2] = 0;\n    next[3] = integrator.put(Vector{d[0], d[1], d[2]});\n}\n"
    )
    monkeypatch.setenv("CC", f"cc -I{tmp_path}/include")
    source = read_source(tmp_path / "adapter.cc", "put", "increments[3] -> next[4]", "begin")
    rows = [[1, 1, 1, 1, 1, 1], [0, 1, 1, 1, 0, 0], [1, 1, 1, 0, 0, 1]]
    run = run_foreign(compile_foreign(source), [0, 0, 0, 1], rows)
    np.testing.assert_array_equal(run.outputs[:, 3], [6, 7, 3])


@pytest.mark.parametrize(
    ("text", "names", "count", "elements"),
    [
        ("state[4], increments[2][3] -> next[4]", "state increments next", 2, 4),
        ("state[4],increments[6]->next[4]", "state increments next", 2, 4),
        ("next[4] <- state[4], increments[3]", "next state increments", 1, 4),
        ("state[3][3], rates[ 1 ][ 3 ], dt -> state[3][3]", "state rates dt", 1, 9),
        ("dt, state[9], rates[4][3] -> state[9]", "dt state rates", 4, 9),
        ("filter_t *filter, rates[3], step -> filter.attitude.q[4]", "filter rates step", 1, 4),
        ("struct filter *f, increments[3] -> next[4]", "f increments next", 1, 4),
        ("nav::Filter &f, increments[3] -> f.q[4]", "f increments", 1, 4),
        ("rates[3], dt -> global q[4]", "rates dt", 1, 4),
        ("increments[4][3] -> rotation[3]", "increments rotation", 4, 3),
        ("state[4], previous[2][3], increments[3] -> next[4]", "state previous increments next", 1, 4),
    ],
)
def test_arguments_are_read_in_the_order_of_c(text, names, count, elements):
    arguments = read_arguments(text)
    assert [argument.name for argument in arguments.parameters] == names.split()
    assert (arguments.count, arguments.elements) == (count, elements)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("state[4], increments[3]", "has no single arrow; 'state.*next.4.' is an example"),
        ("state[4] -> increments[3] -> next[4]", "has no single arrow"),
        (
            "state[4], gyro[3] -> next[4]",
            "'gyro.3.' is not known; allowed: state.4. or state.3..3., increments",
        ),
        ("state[5], increments[3] -> next[5]", "has another shape"),
        (
            "state[4], increments[4] -> next[4]",
            r"increments has the shape \[4\]; \[3\], \[K\]\[3\] or",
        ),
        ("state[4], increments[9][3] -> next[4]", "with K from 1 to 8"),
        (
            "state[4], previous[4][3], increments[3] -> next[4]",
            "previous has the shape .* with K from 1 to 3",
        ),
        ("state[4], increments[3], dt[2] -> next[4]", r"'dt\[2\]' has another shape"),
        ("state[4], increments(3) -> next[4]", "cannot be read"),
        ("state[4], increments[3], increments[3] -> next[4]", "name one thing twice"),
        ("a *b, a *b, increments[3] -> next[4]", "name one thing twice"),
        ("state[4], dt -> next[4]", "lack the samples"),
        ("increments[3], rates[3] -> next[4]", "lack the samples"),
        ("increments[3] -> state[4]", "stands behind the arrow alone"),
        ("state[4], increments[3] -> next[3][3]", "state has 4 numbers .* the result 9"),
        ("state[9], increments[3] -> state[3][3]", "they must agree"),
        ("increments[3] -> filter.q[4]", "the result 'filter.q.4.' is not known; allowed: next"),
        ("increments[3] -> next[3]", r"has another shape; allowed: \[4\], \[9\], \[3\]\[3\], or"),
        ("increments[3] -> next[4], dt", "the result .dt. is not known"),
        ("state[4], increments[3], velocity_increments[3] -> state[4]", "need each other"),
        ("state[4], increments[3], velocity[3] -> state[4], velocity[3]", "need each other"),
        (
            "increments[2][3], forces[3] -> velocity_change[3]",
            "forces has 3 numbers, increments 6; they must",
        ),
        ("increments[3], forces[3] -> next_velocity[3]", "is in reference axes, and needs an attitude there"),
        ("increments[3], forces[3] -> next[4], next_position[3]", "position needs a velocity behind"),
        ("increments[3], forces[3], gravity[3] -> velocity_change[3]", "gravity needs a velocity behind"),
        ("increments[3], forces[3] -> next[4], velocity[3]", "velocity stands behind the arrow alone"),
        ("increments[3], forces[3] -> next[4], velocity_change[4]", "another shape; .3. is needed"),
        (
            "increments[3], forces[3] -> next[4], speed = velocity[3]",
            "names no result; allowed: velocity, pos",
        ),
        ("increments[3], frame_rate[3] -> rotation[3]", "frame_rate needs an attitude behind the arrow"),
        ("increments[3] -> next[4], rotation[3]", "stands twice behind the arrow"),
    ],
)
def test_uncallable_functions_get_one_line(text, says):
    with pytest.raises(InputError, match=says) as caught:
        read_arguments(text)
    assert "\n" not in str(caught.value) and "--arguments" in str(caught.value)


def test_suffixes_of_c_and_cpp():
    assert all(
        is_foreign(f"a{suffix}")
        for suffix in (".c", ".C", ".cc", ".cpp", ".cxx", ".C++", ".c++", ".CPP", ".h", ".hpp")
    )
    assert not any(is_foreign(name) for name in ("euler", "a.py", "a.toml", "c", ".c/none"))


ROOT = Path(__file__).resolve().parents[2]
PLACE = "examples/check_foreign_c"
DOCUMENT = (ROOT / "docs" / "check-foreign-code.md").read_text()
COMMAND = (
    "--function integrator_update --arguments 'state[4], increments[3] -> state[4]' --scalar first "
    "--init integrator_init"
)


@pytest.fixture
def check(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Run the command in the checkout and return its exit status, its output and its messages."""
    monkeypatch.chdir(ROOT)

    def run(words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["check", *shlex.split(words)])
        said = capsys.readouterr()
        return stop.value.code, said.out, said.err

    return run


@pytest.mark.long
def test_the_right_example_passes(check):
    status, printed, said = check(f"{PLACE}/correct.c {COMMAND}")
    assert (status, said) == (0, "")
    reads = "integrator_update(q: state[4], delta_angle: increments[3] in rad) -> state[4]"
    assert printed.startswith(f"{PLACE}/correct.c: integrator_update\nreads: {reads}\n\n")
    assert "FAILS" not in printed and "cause" not in printed
    assert re.search(
        r"^  holds drift +9\.783 deg/h \(0, 9\.781, 0\.1707 about x, y, z\) on a cone of 1 deg at 10 Hz about y, "
        r"samples at 100 Hz; closed form on 1 sample and 1 before 9\.784, coning-\w+ 9\.783; limit 11\.74$",
        printed,
        re.M,
    )


def test_a_fault_exits_with_1_and_names_its_cause(check):
    status, printed, said = check(f"{PLACE}/wrong_sign.c {COMMAND}")
    assert status == 1
    assert (
        "\n\nlikely cause: correction of the wrong sign (confidence 1.00; next best: correction abs"
        in printed
    )
    (excerpt,) = re.findall(r"^```text\n(.*?)^```", DOCUMENT, flags=re.MULTILINE | re.DOTALL)
    assert all(part in printed for part in excerpt.split("...\n"))
    fails = "coefficients, order, drift; likely cause: correction of the wrong sign"
    assert said == f"strapgen: {PLACE}/wrong_sign.c fails: {fails}\n"


def test_json_keeps_its_keys(check, tmp_path):
    out = tmp_path / "check.json"
    status, printed, said = check(f"{PLACE}/state_kept.c {COMMAND} --format json --out {out}")
    assert (status, printed) == (1, "")
    assert said.splitlines()[0] == f"wrote {out}"
    data = json.loads(out.read_text())
    checks = data.pop("checks")
    assert {name: data[name] for name in ("file", "holds", "cause")} == {
        "file": f"{PLACE}/state_kept.c",
        "holds": False,
        "cause": "state kept between runs",
    }
    old, new = {"order", "drift_deg_h", "closed_form_deg_h"}, {"drift_axes_deg_h", "coefficient_ratio"}
    new |= {"drift_by_axis_deg_h", "cause_confidence", "next_cause", "replacement", "replacement_command"}
    assert {*data} == {"schema", "file", "holds", "cause", "coefficients", *old, *new}
    assert data["coefficients"] == [
        {"older": -1, "newer": 0, "seen": pytest.approx(1 / 12, abs=1e-6), "wanted": 1 / 12}
    ]
    assert data["coefficient_ratio"] == pytest.approx(1, abs=1e-5)
    assert all({*each} == {"name", "holds", "value"} for each in checks)
    assert [each["name"] for each in checks if each["holds"] is False] == ["runs"]


@pytest.mark.long
def test_the_page_of_the_examples_names_every_fault_as_the_command_does(check):
    page = (ROOT / PLACE / "README.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+\.c)` \| .*? \| (.*?) \| [\d.]+ \|$", page, flags=re.MULTILINE))
    assert {*rows} == {path.name for path in (ROOT / PLACE).glob("*.c")}
    assert rows.pop("correct.c") == "-"
    assert set(rows.values()) == {
        "correction absent or zero",
        "correction of the wrong sign",
        "correction one sample late",
        "correction off by a factor of 2",
        "state kept between runs",
    }  # tests/experiments runs each of them
    (command,) = re.findall(r"^    strapgen check (.*)$", page.replace("\\\n", ""), flags=re.MULTILINE)
    assert check(command)[0] == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (f"{PLACE}/correct.c", "correct.c needs --function; --function NAME says which"),
        (
            f"{PLACE}/correct.c --function f",
            "has no function f; it has cross, rotate, integrator_init, integrator_update",
        ),
        (f"{PLACE}/none.c {COMMAND}", "none.c is no file"),
        (
            f"{PLACE}/README.md {COMMAND}",
            r"--function goes with a file in C or C\+\+ \(\.c, .*README.md is none",
        ),
        (f"euler {COMMAND}", "--function goes with a file in C"),
        (
            f"{PLACE}/correct.c {COMMAND} --method rk4",
            "--method goes with an algorithm of strapgen; .* is code of your own",
        ),
        (
            f"{PLACE}/correct.c {COMMAND} --sense body",
            "sense 'body' is not known .did you mean body-to-reference or",
        ),
        (
            f"{PLACE}/correct.c {COMMAND.replace('first', '1')}",
            "scalar '1' is not known; allowed: last, first",
        ),
        (f"{PLACE}/correct.c {COMMAND} --sample-hz 0", "--sample-hz is 0; a number above 0 is needed"),
        (f"{PLACE}/correct.c {COMMAND} --sample-hz fast", "--sample-hz is 'fast'; a finite number is needed"),
        (
            f"{PLACE}/correct.c {COMMAND} --input angles",
            "input 'angles' is not known; allowed: increments, rates, instants",
        ),
        ("euler --sample-hz 100", "--sample-hz goes with a file in C"),
        ("euler --gravity-m-s2 0,0,9.8", "--gravity-m-s2 goes with a file in C"),
        (
            f"{PLACE}/correct.c {COMMAND} --gravity-m-s2 0,0,9.8",
            "--gravity-m-s2 goes with a velocity behind the arrow",
        ),
        (f"{PLACE}/correct.c {COMMAND} --gravity-m-s2 9.8", "--gravity-m-s2 is .9.8.; three numbers"),
        (f"{PLACE}/correct.c {COMMAND} --frame-rate-rad-s 0,0,a", "--frame-rate-rad-s .*a"),
        (
            f"{PLACE}/correct.c {COMMAND} --precision half",
            "precision 'half' is not known; allowed: double, float",
        ),
        (f"{PLACE}/correct.c {COMMAND} --out {PLACE}/correct.c", "is a file that the command reads"),
        (f"{PLACE}/correct.c {COMMAND} --format xml", "format 'xml' is not known"),
        (
            f"{PLACE}/correct.c --function integrator_update --arguments 'q[4] -> q[4]'",
            r"'q\[4\]' is not known; allowed: state\[4\]",
        ),
        (
            f"{PLACE}/correct.c --function integrator_update --arguments ''",
            "--arguments '' has no single arrow",
        ),
        (
            f"{PLACE}/correct.c --function integrator_update --arguments 'state[9], rates -> state[9]'",
            "--arguments: state has 9 numbers, `double q.4.` 4",
        ),
        (
            f"{PLACE}/correct.c {COMMAND.replace('update', 'updat')}",
            "no function integrator_updat .did you mean integr",
        ),
        (
            f"{PLACE}/correct.c {COMMAND} --precision float",
            "does not take these --arguments in --precision float",
        ),
    ],
)
def test_unusable_input_gets_one_line_and_status_2(check, words, says):
    status, printed, said = check(words)
    assert (status, printed) == (2, "")
    assert said.startswith("strapgen: ") and said.count("\n") == 1
    assert re.search(says, said), said


def test_a_file_that_does_not_compile_exits_with_2_and_the_first_error(check, tmp_path):
    (tmp_path / "faulty.c").write_text(
        "void integrator_init(void) {}\nvoid integrator_update(double *q) { q[0] = }\n"
    )
    status, printed, said = check(f"{tmp_path}/faulty.c {COMMAND}")
    assert (status, printed) == (2, "")
    assert said.startswith(f"strapgen: {tmp_path}/faulty.c does not compile: {tmp_path}/faulty.c:2:")
    assert "error: expected" in said and said.count("\n") == 1
