"""Functions in Python, Rust and MATLAB: a right one holds, a fault is named, and a wrong call is refused."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from strapgen.cli import main
from strapgen.firmware.check_code import coning_causes as causes
from strapgen.firmware.check_code import foreign
from strapgen.firmware.check_code.check_foreign import check_foreign
from strapgen.firmware.check_code.foreign import Convention, ForeignStep
from strapgen.firmware.check_code.interpreted import interpreted_source
from strapgen.firmware.check_code.rust_source import rust_source
from strapgen.ir.exceptions import StrapgenError

#: The integrators: quaternions with the scalar part last.
PYTHON = """
import numpy as np
from scipy.spatial.transform import Rotation

def product(q, p):
    (x, y, z, w), (a, b, c, s) = q, p
    return np.array([w * a + x * s + y * c - z * b, w * b - x * c + y * s + z * a,
                     w * c + x * b - y * a + z * s, w * s - x * a - y * b - z * c])

def turn(v):
    size = np.linalg.norm(v)
    return np.append(np.sinc(size / 2 / np.pi) / 2 * v, np.cos(size / 2))

def two(state, increments):
    first, second = increments
    return product(state, turn(first + second + FACTOR * np.cross(first, second)))

def listed(q, delta_angle):
    return tuple(product(q, turn(delta_angle)))

def matrix(dcm, increments):
    return dcm @ Rotation.from_rotvec(increments).as_matrix()

def flat(dcm, increments):
    return matrix(dcm.reshape(3, 3), increments).ravel()

def rotated(q: Rotation, increments):
    return q * Rotation.from_rotvec(increments)

def in_place(state, increments):
    state[:] = product(state, turn(increments))

class Filter:
    def __init__(self):
        self.attitude, self.before = np.array([0.0, 0, 0, 1]), np.zeros(3)
    def update(self, gyro, dt):
        angle = gyro * dt
        self.attitude = product(self.attitude, turn(angle + np.cross(self.before, angle) / 12))
        self.before = KEPT
    def returned(self, gyro, dt):
        self.update(gyro, dt)
        return self.attitude

    def by_keyword(self, gyro, *, dt):
        self.update(gyro, dt)

class Four:
    def __init__(self):
        self.bias, self.w, self.x, self.y, self.z = 0.0, 1.0, 0.0, 0.0, 0.0
    def update(self, gx, gy, gz, dt=0.01, mode="plain"):
        four = product([self.x, self.y, self.z, self.w], turn(np.array([gx, gy, gz]) * dt))
        self.x, self.y, self.z, self.w = four

class Unmade(Filter):
    def __init__(self, attitude):
        super().__init__()

def make():
    return Unmade(None)

held = Filter()
def kept(increments):
    return held.returned(increments, 1.0)
"""
MATLAB = """
% One line of comment: function no(x)
function next = step(state, increments)
  a = increments(:, 1); b = increments(:, 2);
  v = a + b + FACTOR * cross(a, b);
  size = norm(v); s = 0.5;
  if size > 1e-9, s = sin(size / 2) / size; end
  p = [s * v; cos(size / 2)]; q = state;
  next = [q(4) * p(1:3) + p(4) * q(1:3) + cross(q(1:3), p(1:3)); q(4) * p(4) - q(1:3)' * p(1:3)];
end
"""
TWO = "state[4], increments[2][3] -> next[4]"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(factor: str = "2 / 3", kept: str = "angle") -> None:
    Path("integrators.py").write_text(PYTHON.replace("FACTOR", factor).replace("KEPT", kept))


def checked(text: str, arguments: str | None = None, convention=Convention(), init: str = "", **more):  # noqa: B008
    source = interpreted_source(text, None, arguments, init, "double")
    return check_foreign(ForeignStep(source, convention, **more))


@pytest.mark.parametrize(
    ("factor", "cause"),
    [
        pytest.param("2 / 3", None, marks=pytest.mark.long),
        ("-2 / 3", causes.WRONG_SIGN),
        pytest.param("1 / 3", causes.FACTOR_TWO, marks=pytest.mark.long),
    ],
)
def test_a_pure_function_in_python(folder, factor, cause):
    write(factor)
    outcome = checked("integrators:two", TWO)
    assert (outcome.holds, outcome.cause) == (cause is None, cause)


@pytest.mark.long
@pytest.mark.parametrize(
    ("kept", "cause"), [("angle", None), ("0 * angle", causes.ABSENT), ("-angle", causes.WRONG_SIGN)]
)
def test_a_class_in_python_that_holds_its_attitude(folder, kept, cause):
    write(kept=kept)
    outcome = checked("integrators.py:Filter.update", "rates[3], dt -> self.attitude[4]", takes="rates")
    assert (outcome.holds, outcome.cause) == (cause is None, cause)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "arguments", "init", "cause"),
    [
        ("Filter.returned", None, "", None),
        ("Unmade.returned", None, "make", None),
        ("Unmade.returned", None, "Unmade('none')", None),
        ("Four.update", None, "", causes.ABSENT),
        ("Filter.by_keyword", "rates, dt -> self.attitude", "", None),
        ("Filter.update", None, "", None),
        ("listed", None, "", causes.ABSENT),
        ("matrix", None, "", causes.ABSENT),
        ("flat", "state[9], increments[3] -> next[9]", "", causes.ABSENT),
        ("in_place", "state[4], increments[3] -> state[4]", "", causes.ABSENT),
        ("rotated", None, "", causes.ABSENT),
        ("kept", None, "", causes.STATE_KEPT),
    ],
)
def test_attitudes_are_read_in_every_shape(folder, name, arguments, init, cause):
    write()
    takes = "rates" if "." in name else "increments"
    outcome = checked(f"integrators:{name}", arguments, init=init, takes=takes)
    assert (outcome.holds, outcome.cause) == (cause is None, cause)


@pytest.mark.long
@pytest.mark.needs("octave-cli")
@pytest.mark.parametrize(("factor", "cause"), [("2 / 3", None), ("-2 / 3", causes.WRONG_SIGN)])
def test_a_function_in_matlab(folder, factor, cause):
    Path("step.m").write_text(MATLAB.replace("FACTOR", factor))
    outcome = checked("step.m", TWO)
    assert (outcome.holds, outcome.cause) == (cause is None, cause)


@pytest.mark.long
def test_what_parameters_are_taken_for_is_said(folder):
    write()
    outcome = checked("integrators:listed")
    assert "reads: listed(q: state[4], delta_angle: increments[3] in rad) -> next[4]" in outcome.text()
    for name, reads in (
        ("Four.update", "gx, gy, gz: rates[3] in rad/s, means, dt) -> self.w x y z[4]"),
        ("Filter.update", "gyro: rates[3] in rad/s, means, dt) -> self.attitude[4]"),
        ("in_place", "state: state[4], increments: increments[3] in rad) -> state[4]"),
        ("matrix", "dcm: state[3][3], increments: increments[3] in rad) -> next[3][3]"),
    ):
        takes = "rates" if "." in name else "increments"
        source = interpreted_source(f"integrators:{name}", None, None, "", "double")
        assert ForeignStep(source, takes=takes).reading == f"reads: {name}({reads}"


#: Functions that cannot be called as they are, or end otherwise.
WRONG = """
import os, time
def raises(state, increments): raise RuntimeError("no\\nattitude")
def short(state, increments): return state[:3]
def words(state, increments): return "abcd"
def nothing(state, increments): return None
def poisoned(state, increments): return state * float("nan")
def hangs(state, increments):
    while True: time.sleep(1)
def ends(state, increments): os._exit(3)
def unpacks(state, increments): (a, b), c = increments
def few(state): return state
def other(state, increments, gain): return state
class Needs:
    def __init__(self, gain): pass
    def update(self, increments): return [0, 0, 0, 1]
value = 1
"""
REFUSED = {
    "absent:step": "there is no module absent in ",
    "absent.py:step": "absent.py is no file",
    "wrong:raise": "has no raise (did you mean raises?); it has raises, short",
    "wrong:value": "value is no function; a method of a class is named Class.method",
    "wrong:Needs": "Needs is no function; a method of a class is named Class.method",
    "wrong:Needs.update": "--init states its arguments, as in Needs(0.01), or a function of the module that makes",
    "wrong:Needs.update --init 'Needs(gain)'": "--init Needs(gain): the arguments of a call are numbers or texts",
    "wrong:short": "short gives an array of the shape [3]; 4 numbers are needed",
    "wrong:words": "words gives a str; 4 numbers are needed",
    "wrong:nothing": "nothing returns None; where it leaves the attitude stands behind the arrow of --arguments",
    "wrong:other": "other: what `gain` is, its name does not say; --arguments is needed",
    "wrong:few": "--arguments: state lack the samples",
    "broken:step": "raises ZeroDivisionError: division by zero in line 1 of broken.py",
    "needing:step": "needing imports not_there, which is not installed",
    "wrong:raises --function f": "--function f goes with a file; wrong:raises names a function already",
    "wrong:few --arguments 'state[4], increments[3] -> state[4]'": "few takes no argument for increments; it takes",
    "wrong:few --increments 2": "--increments goes with an algorithm of strapgen; wrong:few is code of your own",
    "none.m": "none.m is no file",
}
FAILS = {
    "wrong:raises": "it raises RuntimeError: no attitude in line 3 of wrong.py",
    "wrong:poisoned": "it leaves no finite numbers in its result, or does not write all of it",
    "wrong:hangs": "calls have not come to an end in 6 s",
    "wrong:unpacks": "in line 11 of wrong.py; if it takes arrays of other shapes, --arguments says so",
    "wrong:ends": "it ends the program, with exit status 3",
}


@pytest.mark.parametrize(
    "words",
    [
        words if number % 3 == 0 else pytest.param(words, marks=pytest.mark.long)
        for number, words in enumerate([*REFUSED, *FAILS])
    ],
)
def test_a_wrong_callable_gives_one_line(folder, monkeypatch, capsys, words):
    monkeypatch.setattr(foreign, "PATIENCE", 2 if "hangs" in words else 20)
    Path("wrong.py").write_text(WRONG)
    Path("broken.py").write_text("1 / 0\n")
    Path("needing.py").write_text("import not_there\n")
    with pytest.raises(SystemExit) as ended:
        main(["check", *shlex.split(words)])
    said = capsys.readouterr().err.strip()
    assert (ended.value.code, len(said.splitlines())) == (1 if words in FAILS else 2, 1), said
    assert (FAILS | REFUSED)[words] in said


@pytest.mark.long
@pytest.mark.needs("octave-cli")
@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("function q = other(q)\nend\n", "has no function step at first; its first function is other"),
        ("function q = step(state, increments)\n  q = (;\nend\n", "step cannot be read: parse error"),
        ("function q = step(state)\n  q = state;\nend\n", "lack the samples"),
        ("function q = step(state, increments)\n  q = [1 2];\nend\n", "gives an array of the shape [1 2]"),
        ("function q = step(state, increments)\n  error('no way');\nend\n", "it raises an error: no way"),
    ],
)
def test_a_wrong_function_in_matlab_is_refused(folder, text, says):
    Path("step.m").write_text(text)
    try:
        said = checked("step.m").cause
    except StrapgenError as error:
        said = str(error)
    assert says in said and "\n" not in said


def test_octave_that_is_missing_is_said(folder, monkeypatch):
    monkeypatch.setenv("OCTAVE", "no-octave")
    Path("step.m").write_text(MATLAB)
    with pytest.raises(StrapgenError, match="no Octave: 'no-octave' is not on the PATH; install octave"):
        checked("step.m")


#: Two samples a call with references, and one with pointers and a struct.
RUST = """
fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
#[repr(C)]
pub struct Filter { pub q: [f64; 4], pub last: [f64; 3] }
fn turn(q: &mut [f64; 4], v: [f64; 3]) {
    let n = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let s = if n > 1e-9 { (n / 2.0).sin() / n } else { 0.5 };
    let (x, y, z, w) = (s * v[0], s * v[1], s * v[2], (n / 2.0).cos());
    *q = [q[3] * x + q[0] * w + q[1] * z - q[2] * y, q[3] * y - q[0] * z + q[1] * w + q[2] * x,
          q[3] * z + q[0] * y - q[1] * x + q[2] * w, q[3] * w - q[0] * x - q[1] * y - q[2] * z];
}
#[no_mangle] // the C library has a function of this name
pub extern "C" fn step(q: &mut [f64; 4], delta_angle: &[[f64; 3]; 2]) {
    let c = cross(&delta_angle[0], &delta_angle[1]);
    let mut v = [0.0; 3];
    for i in 0..3 { v[i] = delta_angle[0][i] + delta_angle[1][i] + FACTOR * 2.0 / 3.0 * c[i]; }
    turn(q, v);
}
#[no_mangle]
pub unsafe extern "C" fn begin(filter: *mut Filter) { (*filter).q = [0.0, 0.0, 0.0, 1.0]; (*filter).last = [0.0; 3]; }
#[no_mangle]
pub unsafe extern "C" fn update(filter: *mut Filter, gyro: *const f64, dt: f64) {
    let (f, g) = (&mut *filter, std::slice::from_raw_parts(gyro, 3));
    let d = [g[0] * dt, g[1] * dt, g[2] * dt];
    let c = cross(&f.last, &d);
    f.last = d;
    turn(&mut f.q, [d[0] + FACTOR * c[0] / 12.0, d[1] + FACTOR * c[1] / 12.0, d[2] + FACTOR * c[2] / 12.0]);
}
#[no_mangle]
pub extern "C" fn worded(name: &str) {}
"""


@pytest.mark.needs("rustc")
@pytest.mark.parametrize(
    ("factor", "how", "cause"),
    [
        pytest.param("1.0", ("step",), None, marks=pytest.mark.long),
        (*("-1.0", ("step",)), causes.WRONG_SIGN),
        pytest.param(
            *("1.0", ("update", "filter, rates[3], dt -> filter.q", "begin")), None, marks=pytest.mark.long
        ),
        pytest.param(
            *("2.0", ("update", "filter, rates[3], dt -> filter.q", "begin"), causes.FACTOR_TWO),
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_function_in_rust(folder, factor, how, cause):
    Path("step.rs").write_text(RUST.replace("FACTOR", factor))
    takes = "rates" if "update" in how else "increments"
    outcome = check_foreign(ForeignStep(rust_source(Path("step.rs"), *how, takes=takes), takes=takes))
    assert (outcome.file, outcome.holds, outcome.cause) == ("step.rs", cause is None, cause)


@pytest.mark.needs("rustc")
@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        (
            "stop",
            RUST,
            r'step.rs has no extern "C" fn stop \(did you mean step\?\); it has step, begin, update, worded',
        ),
        ("worded", RUST, r"step.rs: name has the type &str; allowed: f64, f32, bool"),
        ("step", RUST, r"step.rs does not compile: error\[E0425\]: .*FACTOR.* \(step.rs:18:\d+\)"),
    ],
)
def test_a_wrong_function_in_rust_is_refused(folder, name, text, says):
    Path("step.rs").write_text(text)
    with pytest.raises(StrapgenError, match=says) as caught:
        rust_source(Path("step.rs"), name)
    assert "\n" not in str(caught.value)


def test_rust_without_a_compiler_or_a_file_is_refused(folder, monkeypatch):
    monkeypatch.setenv("RUSTC", "no-rustc")
    with pytest.raises(StrapgenError, match=r"step\.rs is no file"):
        rust_source(Path("step.rs"), "step")
    Path("step.rs").write_text(RUST)
    with pytest.raises(StrapgenError, match="no Rust compiler: 'no-rustc' is not on the PATH; install rustc"):
        rust_source(Path("step.rs"), "step")
