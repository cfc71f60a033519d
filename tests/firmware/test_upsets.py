"""What a user's function does when its input fails, and in long runs: a right one holds, and a fault is named."""

from __future__ import annotations

import pytest

from strapgen.firmware.check_code.check_foreign import check_foreign
from strapgen.firmware.check_code.foreign import ForeignStep
from strapgen.firmware.check_code.interpreted import interpreted_source

#: A filter that holds its attitude, scalar part last; what it makes of its input and of the state is left open.
FILTER = """
#include <math.h>
#include <stdlib.h>
typedef NUMBER number;
static number before[3], q[4];
void begin(void) { for (int i = 0; i < 3; i++) before[i] = q[i] = 0; q[3] = 1; }
void step(const number gyro[3], number dt)
{
    number d[3], v[3];
    INPUT
    for (int i = 0; i < 3; i++) d[i] = gyro[i] * dt;
    DELTA
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        v[i] = d[i] + (before[j] * d[k] - before[k] * d[j]) / 12;
    }
    for (int i = 0; i < 3; i++) before[i] = d[i];
    const number a = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], n = sqrt(a);
    const number s = HALF_SINE, w = COSINE, x = s * v[0], y = s * v[1], z = s * v[2];
    const number r[4] = {
        q[3] * x + q[0] * w + q[1] * z - q[2] * y, q[3] * y - q[0] * z + q[1] * w + q[2] * x,
        q[3] * z + q[0] * y - q[1] * x + q[2] * w, q[3] * w - q[0] * x - q[1] * y - q[2] * z};
    for (int i = 0; i < 4; i++) q[i] = r[i];
    STATE
}
"""
NORMALIZE = """
    const number l = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++) q[i] /= l;
"""
#: Lets the length grow in the last 300,000 calls of a long run, where rounding explains a unit in each of all calls.
GROWS = "static int k; if (++k > 200000 && k % 4 == 0) for (int i = 0; i < 4; i++) q[i] *= 1 + {}f;"
REJECT = "for (int i = 0; i < 3; i++) if (gyro[i] != gyro[i]) return;"
PARTS = {
    "NUMBER": "double",
    "INPUT": "",
    "DELTA": "",
    "HALF_SINE": "n > 1e-5 ? sin(n / 2) / n : 0.5 - a / 48",
    "COSINE": "cos(n / 2)",
    "STATE": NORMALIZE,
}


@pytest.fixture
def said(outcome):
    """Return the findings on a filter by name, and the cause."""

    def check(**parts: str):
        text = FILTER
        for name, instead in {**PARTS, **parts}.items():
            text = text.replace(name, instead)
        checked = outcome(text, "rates[3], dt -> global q[4]", init="begin")
        return {finding.name: finding for finding in checked.findings}, checked.cause

    return check


def failed(findings) -> list[str]:
    return [name for name, finding in findings.items() if finding.holds is False]


def test_a_right_filter_holds_and_what_it_does_with_wrong_input_is_said(said):
    findings, cause = said()
    assert (failed(findings), cause) == ([], None)
    assert findings["dt of 0"].holds is True and findings["long run"].holds is True
    assert findings["long run"].measured < 1e-12 and "in 500000 calls" in findings["long run"].text
    assert findings["dropouts"].holds is None and findings["dropouts"].text == (
        "dt of 0 at 0.54 rad/s: the attitude stays; dt of -0.01 s: it turns by -1 of a usual call; "
        "dt of 1 s: it turns by 100 of a usual call"
    )
    assert findings["NaN"].holds is None and "stays in the attitude" in findings["NaN"].text


@pytest.mark.parametrize(
    ("parts", "name", "text"),
    [
        ({"INPUT": REJECT}, "NaN", "a NaN in one sample does not reach the attitude"),
        pytest.param(
            {"STATE": f"static int bad; if (bad) begin(); bad = q[0] != q[0]; {NORMALIZE}"},
            *("NaN", "after a NaN in one sample the attitude is not finite in 1 call, then is"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"INPUT": "if (dt < 0) dt = 0; if (dt > 0.1) dt = 0.1;"},
            *("dropouts", "dt of -0.01 s: the attitude stays; dt of 1 s: it turns by 10 of a usual call"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"INPUT": "static int bad; if (dt == 0.01) bad += 0; if (dt > 0.1) bad = 1; if (bad) dt = 0;"},
            *("dropouts", "dt of 1 s: the attitude stays, then freezes"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"NUMBER": "float", "STATE": ""},
            *("long run", "rounding adds up without normalization"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"NUMBER": "float", "STATE": GROWS.format("6.0e-7")},
            *("long run", "rounding adds up without normalization"),
            marks=pytest.mark.long,
        ),
    ],
)
def test_what_is_no_fault_in_itself_is_a_measurement(said, parts, name, text):
    findings, cause = said(**parts)
    assert (failed(findings), cause) == ([], None)
    assert findings[name].holds is None and text in findings[name].text


@pytest.mark.parametrize(
    ("parts", "name", "cause"),
    [
        (
            {"DELTA": "for (int i = 0; i < 3; i++) d[i] = d[i] / dt * 0.01;"},
            *("dt of 0", "at dt = 0 without rotation the attitude becomes NaN"),
        ),
        (
            {"DELTA": "for (int i = 0; i < 3; i++) d[i] = gyro[i] / 100;"},
            *("dropouts", "dt is an argument, and is not used"),
        ),
        pytest.param(
            {"DELTA": "if (dt == 0) d[0] = 0.001;"},
            *("dt of 0", "at dt = 0 without rotation the attitude changes by 0.000"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"INPUT": "if (gyro[0] != gyro[0]) abort();"},
            *("NaN", "at a NaN in one sample it ends with SIGABRT"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"INPUT": "if (dt < 0) for (;;) *(volatile number *)q = 0;"},
            *("dropouts", "calls have not come to an end in"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            {"NUMBER": "float", "STATE": GROWS.format("1.2e-6")},
            *("long run", "the state's length is off in long runs: "),
            marks=pytest.mark.long,
        ),
        (
            {"COSINE": "cos(n / 2) + a * a / 12", "STATE": ""},
            *("long run", "the state's length is off in long runs: 1.00"),
        ),
    ],
)
def test_a_fault_is_named(said, monkeypatch, parts, name, cause):
    monkeypatch.setattr("strapgen.firmware.check_code.foreign.PATIENCE", 5)
    findings, known = said(**parts)
    assert failed(findings) == [name] and cause in known


def test_a_state_that_nothing_begins_is_named(outcome):
    text = FILTER
    for name, instead in {**PARTS, "STATE": ""}.items():
        text = text.replace(name, instead)
    checked = outcome(text, "rates[3], dt -> global q[4]")
    assert not checked.holds
    assert (
        checked.cause
        == "the attitude stays zero: --init names what makes it no rotation before the first call"
    )


@pytest.mark.long
def test_an_exception_at_a_nan_is_no_fault(tmp_path):
    (tmp_path / "refusing.py").write_text(
        "import numpy as np\nfrom scipy.spatial.transform import Rotation\n"
        "def step(dcm, increments):\n"
        "    if np.isnan(increments).any(): raise ValueError('no number')\n"
        "    a, b = increments\n"
        "    return dcm @ Rotation.from_rotvec(a + b + 2 / 3 * np.cross(a, b)).as_matrix()\n"
    )
    arguments = "state[3][3], increments[2][3] -> next[3][3]"
    source = interpreted_source(str(tmp_path / "refusing.py:step"), None, arguments, "", "double")
    outcome = check_foreign(ForeignStep(source))
    (finding,) = (each for each in outcome.findings if each.name == "NaN")
    assert outcome.holds and finding.holds is None
    assert finding.text.startswith("at a NaN in one sample it raises ValueError: no number in line 4")
