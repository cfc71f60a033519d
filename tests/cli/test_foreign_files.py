"""``strapgen check`` on five integrators as flight code has them, from the command line."""

from __future__ import annotations

import json
import math
import shlex
from pathlib import Path

import pytest

from strapgen.cli import main

FILES = Path(__file__).resolve().parents[1] / "data" / "foreign"
#: File, and the options that say how its function is called.
COMMANDS = {
    "interval_guard": "--function update --arguments 'rates[3], dt -> next[4]' --scalar first --init begin",
    "coefficient_in_float": "--function rotation_of_call --arguments 'increments[3] -> rotation[3]' --init begin",
    "accumulated_angle_late": "--function delta_angle --arguments 'increments[4][3] -> rotation[3]' --init begin",
    "first_order_matrix": "--function update --arguments 'increments[3] -> next[3][3]' --init begin",
    "rates_at_ends": "--function update --arguments 'rates[3], dt -> next[4]' --scalar first --init begin",
}
SUM_LATE = "the sum of the samples before lacks the last one (one sample late)"


@pytest.fixture
def check(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Run the command and return its exit status and what it writes as JSON, with the checks by their names."""

    def run(name: str, more: str = "", flags: str = "") -> tuple[int, dict]:
        if flags:
            monkeypatch.setenv("CC", f"gcc {flags}")
        out = tmp_path / f"check{len(list(tmp_path.iterdir()))}.json"
        words = shlex.split(f"{COMMANDS[name]} {more} --format json --out")
        with pytest.raises(SystemExit) as stop:
            main(["check", str(FILES / f"{name}.c"), *words, str(out)])
        capsys.readouterr()
        data = json.loads(out.read_text())
        data["fails"] = [each["name"] for each in data.pop("checks") if each["holds"] is False]
        return stop.value.code, data

    return run


@pytest.mark.parametrize("more", ["", pytest.param("--sample-hz 16", marks=pytest.mark.long)])
def test_code_that_guards_its_interval_holds(check, more):
    status, data = check("interval_guard", more)
    assert (status, data["fails"], data["cause"]) == (0, [], None)
    assert (data["order"], data["drift_deg_h"]) == pytest.approx((3.00, 9.783), abs=0.005)


def test_an_interval_that_the_code_refuses_is_no_sample_interval(check):
    status, data = check("interval_guard", "--sample-hz 15")
    assert (status, data["cause"]) == (1, "a small rotation about an axis does not turn the attitude")


@pytest.mark.parametrize(
    ("more", "flags", "within"), [("--precision float", "", 0), ("", "-DNUMBER=double", 0.05)]
)
def test_a_coefficient_4_percent_off_fails_in_either_precision(check, more, flags, within):
    status, data = check("coefficient_in_float", more, flags)
    assert (status, data["fails"]) == (1, ["coefficients", "order", "drift"])
    assert data["cause"] == "correction 0.96 times as large as needed"
    assert data["order"] == pytest.approx(2, abs=within)
    assert data["coefficient_ratio"] == pytest.approx(12 / 12.5, abs=2e-4)
    assert data["drift_deg_h"] == pytest.approx(14.48, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize("samples", [4, 2])
def test_a_sum_one_sample_late_is_named(check, monkeypatch, samples):
    words = COMMANDS["accumulated_angle_late"].replace("[4]", f"[{samples}]")
    monkeypatch.setitem(COMMANDS, "accumulated_angle_late", words)
    status, data = check("accumulated_angle_late", flags=f"-DN={samples}")
    assert (status, data["fails"], data["cause"]) == (1, ["coefficients", "order", "drift"], SUM_LATE)
    status, data = check("accumulated_angle_late", flags=f"-DN={samples} -DMENDED")
    assert (status, data["fails"], data["cause"]) == (0, [], None)


def test_a_matrix_turned_to_first_order_is_named_with_its_drift(check):
    status, data = check("first_order_matrix")
    assert (status, data["cause"]) == (1, "the rotation itself is of first order")
    assert data["fails"] == ["rotation", "order", "drift", "symmetry"]
    assert data["drift_deg_h"] == pytest.approx(15.1, abs=0.05)
    x, y, z = map(abs, data["drift_by_axis_deg_h"])
    assert (x, math.hypot(y, z)) == pytest.approx((11.4, 9.87), abs=0.05)


def test_rates_at_the_ends_of_intervals_hold_once_they_are_said_to_be(check):
    status, data = check("rates_at_ends")
    assert (status, data["fails"]) == (1, ["delay", "order", "drift"])
    assert data["cause"].startswith("rates at instants are taken for means: ")
    status, data = check("rates_at_ends", "--input rates-at-ends")
    assert (status, data["fails"], data["cause"]) == (0, [], None)
    assert data["order"] == pytest.approx(1.99, abs=0.02)
