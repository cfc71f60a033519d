"""JSON Schemas: what every command prints as JSON is what its schema says, and the files in docs are in step."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from shutil import which
from types import GenericAlias, SimpleNamespace
from typing import TypeVar

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from numpy.typing import NDArray

from strapgen import registration
from strapgen.cli import main
from strapgen.results.records import UNITS, type_schema

ROOT = Path(__file__).resolve().parents[2]
RUN = "--motion constant --set y_deg_s=10 --step 0.5 --duration 1"
WAVE = "--step 0.02 --frequency-hz 10 --theta-x-rad 0.01 --theta-y-rad 0.02 --phase-rad 1.1"
FOREIGN = (
    "examples/check_foreign_c/correct.c --function integrator_update --arguments 'state[4], increments[3] -> state[4]' "
    "--scalar first --init integrator_init"
)
#: Command lines by the schema of what they print with --format json.
COMMANDS = {
    f"simulate euler {RUN} --matrices --title a --initial-deg 1,2,3": "run",
    f"simulate euler --rates --method rk1 {RUN}": "run",
    "simulate two-speed-euler --motion constant --set y_deg_s=10 --duration 1": "run",
    "simulate dcm --recording tests/data/increments.csv --title a": "attitude",
    "log tests/data/increments.csv": "log",
    "certify euler --recording tests/data/increments.csv": "certificate",
    "certify two-speed-euler --recording examples/inertial_log.csv": "system-certificate",
    f"compare euler --method rk1,rk2 --backend numpy,c {RUN}": "comparison",
    "compare euler,dcm --method rk1 --recording tests/data/increments.csv": "spread",
    "converge euler --method rk1 --steps 1/2,1/4 --duration 1 --backend numpy": "convergence",
    "cost euler --cpu cortex-m3": "cost",
    "study word-length --method rk1 --word 16 --carry none --duration 1": "word-length",
    "study monte-carlo euler --runs 20 --length 10 --jobs 1": "random-runs",
    f"study sensor-errors examples/sensors/ins-1.toml {RUN} --runs 10": "sensor-errors",
    "list": "names",
    "list backends": "names",
    "derive euler --show operations": "kernel",
    "derive dcm --method rk1 --rates --show latex": "kernel",
    "derive dcm --method rk1 --show program": "kernel",
    "derive examples/three_samples.py": "kernel",
    "generate euler --method rk1 --target c,c-fixed --out OUT": "generated",
    "generate euler-from-dcm --target c --out OUT": "generated",
    "generate euler --target numpy --out OUT; generate euler --target numpy --check --out OUT": "in-step",
    "generate --all --target numpy --out OUT": "catalogue",
    "two-speed dcm --sculling 1 --target c-fixed --out OUT": "two-speed",
    "system examples/strapdown.toml --target c-fixed --word 16": "system",
    "strapdown examples/strapdown.toml --recording examples/inertial_log.csv": "system-outputs",
    "compare two-speed-euler --backend c,c-fixed16 --motion constant --set y_deg_s=10 --duration 0.1": (
        "system-comparison"
    ),
    "simulate examples/strapdown.toml --motion polar --step 0.01 --duration 1": "flight",
    "study flight-errors examples/navigator.toml --errors ins-1 --duration 2 --sample-hz 50 --runs 10": "flight-errors",
    "study system examples/strapdown.toml --sample-hz 100 --duration 1 --backend c-float": "system-study",
    "strapdown euler --recording examples/inertial_log.csv --fast-cycles 4 --slow-cycles 50": "course",
    "redundancy examples/hexad.toml --out OUT": "redundant-sensors",
    "study redundancy --trials 10": "redundancy",
    "study calibration examples/positions-20.toml --rate-deg-s 10,0,0": "calibration",
    "study calibration examples/turning.toml --errors ins-1 --runs 10": "calibration",
    "study attitude-form --update-hz 100 --max-rate-deg-s 200": "attitude-form",
    "study output-filter --cutoff-hz 8 --sample-hz 100 --backend numpy,c-fixed16": "output-filter",
    "study pulse-torque": "pulse-torque",
    "study loops --last 0": "loops",
    "rate-table --algorithm dcm --backend numpy --duration 1": "rate-table",
    "study velocity-position --method rk4:2 --duration 1": "velocity-position",
    "tableau rk4": "tableau",
    "tableau dormand-prince5": "tableau",
    "tableau examples/heun3.toml": "tableau-families",
    "solve examples/three_samples.py --order 4 --set a=57/80": "solution",
    "solve examples/three_samples.py --order 5 --on polynomial": "solution",
    "series euler --method rk1,rk2 --terms 1": "series",
    "series dcm --method rk1 --motion constant --terms 1": "series",
    "series examples/three_samples.py --terms 1": "series",
    "series velocity-position --method rk1": "velocity-series",
    "series dcm --all --method rk1": "overview",
    "series dcm --method rk1 --motion constant --versus euler": "ratio",
    f"vibration euler --method rk1,rk2 {WAVE} --acceleration-y 3": "vibration",
    f"vibration euler --method rk1 {WAVE}": "vibration",
    "vibration dcm --step 0.02 --spectrum examples/vibration.csv": "vibration",
    "vibration examples/three_samples.py": "vibration-closed-forms",
    "stability dcm --method rk1,magnus4": "stability",
    "coning --samples 2 --previous 1 --form combined --terms": "coning",
    "coning --samples 1 --previous 3 --objective band --band-hz 20 --sample-hz 100": "shaped-coning",
    "coning --samples 1 --previous 3 --objective worst --spectrum examples/vibration.csv --sample-hz 200": (
        "shaped-coning"
    ),
    "window show window-3-3": "window",
    "window generate window-3-3 --target c --out OUT": "late-sources",
    "preintegrate --window pair-1-5 --out OUT": "preintegration",
    "kalman examples/kalman/gyrocompass.toml --target c-fixed": "kalman",
    "stamped --sample-hz 200 --tick-hz 1e6 --out OUT": "stamped",
    "frontier --method rk4:2 --duration 1 --jobs 1": "frontier",
    "design examples/briefs/ahrs.toml --method coning-compressed --simulate 1 --jobs 1": "selection",
    "tables --table 3 --backend numpy": "thesis-tables",
    "tables --predict": "predicted-tables",
    "statements": "statements",
    "vectors euler --max-rate-deg-s 400 --step 0.01 --count 20 --out OUT": "vectors",
    "check euler --method rk1": "findings",
    "check FOREIGN": "foreign-check",
    "verify generated/c_fixed/euler_rk4_2_w32.c": "verification",
    "two-speed euler --sculling 1 --target c-fixed --out OUT; verify OUT": "whole-verification",
    "evidence euler --method rk1 --tool gappa": "evidence",
    "build --check": "build",
}
SCHEMAS = registration.schemas()
RESULTS = [name for name, one in SCHEMAS.items() if one.kind == "result"]


def strict(schema):
    """Return a schema that allows no keys but those that it names."""
    if isinstance(schema, list):
        return [strict(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {"additionalProperties": False} if isinstance(schema.get("properties"), dict) else {}
    return closed | {key: strict(part) for key, part in schema.items()}


def answer(line: str, capsys) -> str:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(line))
    said = capsys.readouterr()
    assert stop.value.code in (0, 1), said.err
    return said.out


@pytest.mark.parametrize("line", COMMANDS)
def test_json_meets_its_schema(line, capsys, monkeypatch, tmp_path):
    name = COMMANDS[line]
    monkeypatch.chdir(ROOT / "examples/variants" if name == "build" else ROOT)
    if name == "cost" and which("arm-none-eabi-gcc") is None:
        pytest.skip("no cross compiler")
    *before, last = line.replace("OUT", str(tmp_path)).replace("FOREIGN", FOREIGN).split("; ")
    for one in before:
        answer(one, capsys)
    data = json.loads(answer(f"{last} --format json", capsys))
    schema = SCHEMAS[name].read()
    for one in data if isinstance(data, list) else [data]:
        assert one["schema"] == f"strapgen/{name}/1" == schema["$id"]
    wrong = [
        f"{error.json_path}: {error.message}"
        for error in Draft202012Validator(strict(schema)).iter_errors(data)
    ]
    assert not wrong


def test_every_result_is_printed_by_a_command_above():
    assert {*RESULTS} == {*COMMANDS.values()}


@pytest.mark.parametrize("name", RESULTS)
def test_every_schema_is_valid_and_in_docs(name):
    schema = SCHEMAS[name].read()
    Draft202012Validator.check_schema(schema)
    assert json.loads((ROOT / "docs" / "schemas" / f"{name}.json").read_text()) == schema


def test_docs_have_no_other_schemas():
    assert {path.stem for path in (ROOT / "docs" / "schemas").iterdir()} == {*RESULTS}


Number = TypeVar("Number")


@pytest.mark.parametrize(
    ("meant", "parts", "schema"),
    [
        (NDArray[np.float64], (), {"type": "array", "items": {"type": ["number", "array"]}}),
        (list[Number], (float,), {"type": "array", "items": {"type": "number"}}),
        (
            list[Number] | None,
            (int,),
            {"anyOf": [{"type": "array", "items": {"type": "integer"}}, {"type": "null"}]},
        ),
    ],
)
def test_names_of_types_stand_for_what_they_mean(meant, parts, schema):
    """A statement ``type Array[Number] = ...``, which Python 3.11 has not; NDArray of NumPy 2.5 is one."""
    name = SimpleNamespace(__value__=meant)
    assert (
        type_schema(GenericAlias(name, parts) if parts else name)
        == schema
        == type_schema(meant[parts] if parts else meant)
    )


def test_numbers_have_the_units_that_their_names_end_with():
    rows = SCHEMAS["comparison"].read()["items"]["properties"]
    assert {name: rows[name].get("unit") for name in ("rms_rad", "drift_deg", "ns_per_step", "kernel")} == {
        "rms_rad": "rad",
        "drift_deg": "deg",
        "ns_per_step": "ns",
        "kernel": None,
    }
    ends = list(UNITS)
    assert not [one for k, one in enumerate(ends) for long in ends[k + 1 :] if long.endswith(f"_{one}")]


def test_invalid_name_is_reported(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["schema", "comparisons"])
    said = capsys.readouterr()
    assert stop.value.code == 2 and not said.out
    assert said.err.startswith("strapgen: schema 'comparisons' is not known") and said.err.count("\n") == 1


def test_schema_lists_all_names_and_prints_each(capsys):
    listed = [line.split() for line in answer("schema", capsys).splitlines()]
    assert listed == [[one.kind, name] for name, one in SCHEMAS.items()]
    for name in ("comparison", "tableau", "tableau.toml"):
        assert json.loads(answer(f"schema {name}", capsys)) == SCHEMAS[name].read()
