"""A user's function in C: it is called as its file says, and what it does wrong stays in a process of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from strapgen.firmware.check_code import foreign
from strapgen.firmware.check_code.foreign import compile_foreign, run_foreign
from strapgen.firmware.check_code.foreign_arguments import ForeignSource, read_arguments
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
    arguments = read_arguments("state[4], previous[1][3], increments[2][3], dt, step -> next[4]")
    module = compile_foreign(ForeignSource(file, "look", arguments, "begin"))
    row = [0.5, 1.0, 7.0, 0, 0, *range(6)]
    run = run_foreign(module, [100, 0, 0, 0], [[1, *row], [0, *row], [1, *row]])
    assert not (run.stopped or run.writes_beyond or run.changes_inputs)
    np.testing.assert_array_equal(
        run.outputs[:, 0], [101, 103, 101]
    )  # the second call takes the state of the first
    np.testing.assert_array_equal(run.outputs[:, 1:], np.tile([57, 0.5, 1], (3, 1)))
    assert compile_foreign(ForeignSource(file, "look", arguments, "begin")) == module  # from the cache


def test_what_a_function_does_wrong_is_told(file, monkeypatch):
    module = compile_foreign(
        ForeignSource(file, "beyond", read_arguments("state[4], increments[3] -> state[4]"))
    )

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
        ("beyond", "", IN_PLACE, "float", "does not take these --arguments in --precision float: error: "),
        pytest.param(
            *("beyond", "", "dt, increments[3] -> next[4]", "double", "incompatible|too many"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            *("beyond", "start", IN_PLACE, "double", "--init: .* has no function start"),
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_call_that_does_not_fit_is_an_error_of_the_compiler(
    file, function, init, arguments, precision, says
):
    with pytest.raises(CompilerError, match=says) as caught:
        compile_foreign(ForeignSource(file, function, read_arguments(arguments), init, precision))
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
        compile_foreign(
            ForeignSource(Path("faulty.c"), "f", read_arguments("state[4], increments[3] -> state[4]"))
        )


def test_names_and_files_are_looked_at_before_anything_is_compiled(file, tmp_path):
    arguments = read_arguments("state[4], increments[3] -> state[4]")
    (tmp_path / "a.h").write_text("")
    with pytest.raises(InputError, match=r"a\.h is no file in C or C\+\+ by its suffix; allowed: \.c, \.cc"):
        ForeignSource(tmp_path / "a.h", "f", arguments)
    with pytest.raises(InputError, match="is no file"):
        ForeignSource(tmp_path / "none.c", "f", arguments)
    with pytest.raises(InputError, match=r"--function is 'f\(\)'; the name of a function is needed"):
        ForeignSource(file, "f()", arguments)
    with pytest.raises(InputError, match="--init is 'a b'"):
        ForeignSource(file, "f", arguments, "a b")
    with pytest.raises(InputError, match="precision 'half' is not known; allowed: double, float"):
        ForeignSource(file, "f", arguments, "", "half")


def test_a_function_that_is_defined_nowhere_is_named(tmp_path):
    (tmp_path / "a.c").write_text(
        "void other(double *q);\nvoid f(double q[4], const double d[3]) { other(q); }\n"
    )
    module = compile_foreign(ForeignSource(tmp_path / "a.c", "f", read_arguments(IN_PLACE)))
    with pytest.raises(
        CompilerError, match=r"cannot be linked: undefined symbol: other; include the file"
    ) as caught:
        run_foreign(module, [0, 0, 0, 1], [[1, 1, 1, 0, 0, 0]])
    assert "\n" not in str(caught.value)


@pytest.mark.long
def test_the_function_of_init_gets_what_it_takes(tmp_path):
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
        source = ForeignSource(tmp_path / "a.c", function, read_arguments(arguments), init)
        run = run_foreign(compile_foreign(source), [0, 0, 0, 1], [[1, 1, 1, 2, 0, 0], [0, 1, 1, 3, 0, 0]])
        np.testing.assert_array_equal(run.outputs[:, 1:3], [[second, 2], [second, 5]])
    with pytest.raises(
        CompilerError, match="of_both of --init does not take the memory, the state or nothing: error"
    ):
        compile_foreign(ForeignSource(tmp_path / "a.c", "put", read_arguments(memory), "of_both"))


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
    source = ForeignSource(
        tmp_path / "adapter.cc", "put", read_arguments("increments[3] -> next[4]"), "begin"
    )
    rows = [[1, 1, 1, 1, 1, 1], [0, 1, 1, 1, 0, 0], [1, 1, 1, 0, 0, 1]]
    run = run_foreign(compile_foreign(source), [0, 0, 0, 1], rows)
    np.testing.assert_array_equal(run.outputs[:, 3], [6, 7, 3])
