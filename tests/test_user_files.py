"""Users' TOML files of every kind: schemas, examples, the page of keys, and one line for what is wrong."""

from __future__ import annotations

import copy
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen import registration
from strapgen.catalogue import toml_models
from strapgen.cli import main
from strapgen.ir.exceptions import InputError

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs"))

import user_files  # noqa: E402

SCHEMAS = {kind: schema() for kind, schema in toml_models.schemas().items()}
MODELS = {
    kind: registration.load(place).model
    for one in registration.built_in().values()
    for kind, place in one.files.items()
}
EXAMPLES = user_files.examples()


def test_schemas_and_page_are_those_of_the_models():
    """If this fails, run python docs/user_files.py."""
    wrong = [
        path
        for path, text in user_files.files().items()
        if not path.is_file() or path.read_text("utf-8") != text
    ]
    assert wrong == []
    assert {path.stem for path in toml_models.FOLDER.iterdir()} == set(SCHEMAS)


def test_every_file_that_users_copy_names_the_schema_of_its_kind():
    copied = {
        path
        for folder in ("examples", "codegen")
        for path in (ROOT / folder).rglob("*.toml")
        if path.name
        # Data of the package, and of a script of the examples.
        not in ("pyproject.toml", "boundary_filters.toml", "stacks.toml")
    }
    assert copied == set(EXAMPLES) and set(EXAMPLES.values()) == set(SCHEMAS)
    for path, kind in EXAMPLES.items():
        named = path.parent / path.read_text("utf-8").partition("\n")[0].removeprefix("#:schema ")
        assert named.resolve() == toml_models.FOLDER / f"{kind}.json"


def test_every_example_is_valid():
    for path, kind in EXAMPLES.items():
        data = tomllib.loads(path.read_text("utf-8"))
        jsonschema.Draft202012Validator(SCHEMAS[kind]).validate(data)
        toml_models.parse(MODELS[kind], data)


def properties(schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the schemas of all keys, those of inner tables among them."""
    found = []
    for key, value in schema.items():
        inner = value.values() if key == "properties" else [value] if isinstance(value, dict) else []
        found += list(inner) if key == "properties" else []
        found += [one for part in inner for one in properties(part)]
    return found


@pytest.mark.parametrize("kind", SCHEMAS)
def test_every_key_is_described_with_its_unit(kind):
    schema = SCHEMAS[kind]
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["title"] and schema["description"].endswith(".")
    for key in properties(schema):
        assert re.match("[A-Za-z0-9]", key["description"]), key
        assert "unit" not in key or key["description"].endswith(f"[{key['unit']}]")
        if key["title"].endswith(("_hz", "_s", "_deg_h", "_rad")):
            assert "unit" in key, key


#: Values that may stand at a place of a file.
VALUES = st.recursive(
    st.one_of(
        st.integers(-3, 70),
        st.integers(),
        st.floats(allow_nan=False, allow_infinity=False),
        st.booleans(),
        st.sampled_from(["", "1/3", "sqrt(2)", "T", "2*T", "one", "b", "gyro", "zero", "50 Hz", "-B/3"]),
        st.text(max_size=5),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=4), inner, max_size=3)
    ),
    max_leaves=6,
)


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of all values of a file."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [one for key, value in entries for one in [(*path, key), *places(value, (*path, key))]]


@settings(deadline=None)
@given(data=st.data())
def test_reader_refuses_as_the_schema_in_one_line(data):
    path = data.draw(st.sampled_from([path for path in EXAMPLES if path.stat().st_size < 10_000]))
    kind, file = EXAMPLES[path], copy.deepcopy(tomllib.loads(path.read_text("utf-8")))
    *way, last = data.draw(st.sampled_from(places(file)))
    table = file
    for key in way:
        table = table[key]
    table[last] = data.draw(VALUES)
    if isinstance(table, dict) and data.draw(st.booleans()):
        table["colour"] = 1
    is_valid = jsonschema.Draft202012Validator(SCHEMAS[kind]).is_valid(file)
    try:
        toml_models.parse(MODELS[kind], file)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert is_valid, (path, way, last, table[last])


#: By kind: a file, the command that reads it, and changes of the file with what is said of them.
WRONG = {
    "motion": (
        "examples/courses/circuit.toml",
        "simulate two-speed-euler --motion FILE --step 0.02 --duration 1",
        [
            ('kind = "hold"', 'kind = "wait"', "leg[1].kind 'wait' is not known; allowed: hold, accelerate"),
            ("duration_s = 20", "", "a leg of kind hold needs duration_s"),
            ("duration_s = 20", "bank_deg = 3\nduration_s = 20", "a leg of kind hold has no bank_deg; it takes"),
            ("duration_s = 20", "duration_s = 0", "duration_s is 0; a number above 0"),
            ("latitude_deg = 47.5", "latitude_deg = 91", "latitude_deg is 91; a number from -90 to 90"),
            ("latitude_deg = 47.5", 'latitude_deg = "north"', "latitude_deg"),
            ("heading_deg = 140", "heading_deg = 140\nspeed_m_s = -1", "speed_m_s is -1"),
            ("bank_deg = 25", "bank_deg = 20\nrate_deg_s = 3", "a turn has bank_deg and rate_deg_s; one of"),
            ("bank_deg = 25", "bank_deg = 89", "bank_deg is 89; a number above 0 and of at most 80"),
            ("height_m = 600", "height_m = 70000", "height_m is 70000"),
            ("speed_m_s = 80", "speed_m_s = 2000", "speed_m_s is 2000"),
            ("speed_m_s = 80", "speed_m_s = 0", "leg 2: this accelerate changes nothing; leave it out"),
            (
                'kind = "accelerate"\nspeed_m_s = 80\nacceleration_m_s2 = 2.5', 'kind = "hold"\nduration_s = 1',
                "leg 3: a vehicle that stands does not climb; accelerate first",
            ),
            ("acceleration_m_s2 = 2\n", "acceleration_m_s2 = 0\n", "acceleration_m_s2 is 0"),
            ("[start]", "[begin]", "key 'begin' is not known"),
        ],
    ),
    "tableau": (
        "codegen/strapgen/catalogue/methods/butcher_tableaux/rk3.toml",
        "tableau FILE",
        [
            ("order = 3", "", "order is missing; a whole number from 1 to 10 is needed"),
            ("order = 3", 'order = "3"', "order is '3'; a whole number from 1 to 10 is needed"),
            ("order = 3", "order = 11", "order is 11; a whole number from 1 to 10 is needed"),
            ("order = 3", "ordre = 3", "key 'ordre' is not known (did you mean order?); allowed: name"),
        ],
    ),
    "tableau-with-unknowns": (
        "examples/heun3.toml",
        "tableau FILE",
        [
            ('"c2", "c3", "a31"', '"c2", "c2", "a31"', "unknowns holds c2 twice"),
            ("order = 3", "order = 7", "order is 7; a whole number from 1 to 6 is needed"),
            ('["b1", "b2", "b3"]\n', "[0.5, 0, 0]\n", "weights[1] is 0.5; a whole number, or a text such as"),
        ],
    ),
    "window": (
        "codegen/strapgen/catalogue/methods/window_filters/window-3-3.toml",
        "window show FILE",
        [
            ('band = "1.3"', 'band_hz = "1.3"', "key 'band_hz' is not known (did you mean band?)"),
            ('band = "1.3"', 'band = "3"', "band is '3'; a number above 0 and below 3 in rad a sample is needed"),
            ('objective = "minimax"', "objective = 1", "objective is 1; 'minimax' or 'mean square' is needed"),
            ("previous = 4", "previous = 5", "one_sided[1]: 5 samples before and 2 ahead are not among those"),
        ],
    ),
    "coning": (
        "codegen/strapgen/catalogue/methods/coning_shapes/coning-shaped-8.toml",
        "derive euler --coning FILE",
        [
            ("samples = 1", "samples = 9", "samples is 9; a whole number from 1 to 8 is needed"),
            ("samples = 1", "samples = true", "samples is true; a whole number from 1 to 8 is needed"),
            ("previous = 8\n", "", "previous is missing; a whole number from 0 to 32 is needed"),
        ],
    ),
    "sensor-errors": (
        "examples/sensors/ins-1.toml",
        "study sensor-errors FILE --motion constant --set rate_deg_s=1 --step 0.1 --duration 1",
        [
            ("pulse_arcsec", "pulse_deg", "gyro: key 'pulse_deg' is not known (did you mean pulse_arcsec"),
            ("pulse_arcsec = 2", "pulse_arcsec = -2", "gyro.pulse_arcsec is -2; a number from 0 to"),
            ("pulse_arcsec = 2", "pulse_arcsec = [1, 2]", "gyro.pulse_arcsec has 2 entries; 3 are needed"),
            ('"ins-1"', '"ins-2"', "class 'ins-2' is not known (did you mean ins-1"),
        ],
    ),
    "brief": (
        "examples/briefs/ahrs.toml",
        "design FILE",
        [
            ("drift_deg_h", "drift_deg_s", "budget: key 'drift_deg_s' is not known (did you mean drift_deg_h?)"),
            ("sample_hz = 200", "sample_hz = 1e7", "gyro.sample_hz is 1e+7; a number above 0 and of at most 1000000"),
            ("[gyro]", "[[gyro]]", "gyro is a list of tables; a table with sample_hz"),
            ("frequency_hz = 20, ", "", "vibration.lines[1].frequency_hz is missing; a number above 0 in Hz"),
        ],
    ),
    "system": (
        "examples/attitude.toml",
        "system FILE",
        [
            ('every = "0.5 Hz"', "every = 1.5", ".every is 1.5; a whole number from 1 to 1048576 or a text as '50 Hz'"),
            ("range = ", "range_deg = ", "key 'range_deg' is not known (did you mean range?)"),
            ("sample_hz", "sample_khz", "key 'sample_khz' is not known (did you mean sample_hz?)"),
        ],
    ),
    "loops": (
        "codegen/strapgen/navigation/loops/ltr81.toml",
        "study loops FILE",
        [
            ('name = "fine"', 'name = "fast"', "two modes of the schedule have the same name"),
            ("gravity = 9.81", "gravity = 0", "gravity is 0; a number from 0.001 to 1000 in m/s^2 is needed"),
            ("{ tau_s = 40 }", "{ tau_ms = 40 }", "mode[fast].heading: key 'tau_ms' is not known"),
            ("cycle_s = 0.01", "cycle_s = 0.000001", "cycle_s is 0.000001; a number from 1e-05 to 1000 in s"),
        ],
    ),
    "layout": (
        "examples/layouts/skewed.toml",
        "derive separate --layout FILE",
        [
            ("sign = 1", "sign = 0", "sign is 0; 1 or -1 is needed"),
            ("turn_deg", "turn_rad", "gyros[1]: key 'turn_rad' is not known (did you mean turn_deg?)"),
            ("x = [0, 0, 1]", "x = [0, 1]", "gyros[1].x has 2 entries; 3 are needed"),
        ],
    ),
    "filter": (
        "examples/filters/cascade.toml",
        "study output-filter FILE",
        [
            ("zeros = [[0.6, 0.8]]", "zeros = [[0.6]]", "section[1].zeros[1] has 1 entry; 2 are needed"),
            ("[[0.5, 0.6]]", "[[0.6, 0.8]]", "section[1]: pole 0.6 +- 0.8 i is on or outside the unit circle; all"),
            ("[[0.5, 0.6]]", "[[-1.5, 0]]\n", "section[1]: zeros are 2, poles 1; no more zeros than poles are needed"),
            ("[[0.5, 0.6]]", "[[-1.5, 0], [0, 0]]", "section[1]: pole -1.5 is on or outside the unit circle"),
            ("[[0.5, 0.6]]", "[[0.5, -0.6]]", "poles has [0.5, -0.6]; an imaginary part of at least 0 is needed"),
            ("poles = [[0.5, 0.6]]", "", "section[1]: a section of kind poles needs poles"),
            ("[[0.5, 0.6]]", "[[0.6, 0.79999999999999999]]", "does not settle in 200000 cycles"),
            ("frequency_hz = 20", "frequency_hz = 100", "section[2]: frequency_hz is 100; from 0.002 to below 100 is"),
            ("frequency_hz = 20", "frequency_hz = 0.001", "section[2]: frequency_hz is 0.001; from 0.002 to below 100"),
            ("frequency_hz = 20", "frequency_hz = -1", "section[2].frequency_hz is -1; a number above 0 in Hz"),
            ("order = 4", "order = 9", "section[2].order is 9; a whole number from 1 to 8 is needed"),
            ("order = 4\n", "", "section[2]: a section of kind butterworth needs order"),
            ("order = 4", "order = 4\ndepth_db = 3", "kind butterworth has no depth_db; it takes frequency_hz, order"),
            ('"butterworth"', '"chebyshev"', "section[2].kind 'chebyshev' is not known; allowed: lag"),
            ('"butterworth"\norder = 4', '"lag"\ntime_constant_s = 1', "a lag has one of frequency_hz and time_const"),
            ('"butterworth"\norder = 4', '"lead-lag"\norder = 3\ngain_db = 3', "order is 3; 1 or 2 is needed for a"),
            ('"butterworth"\norder = 4', '"lead-lag"\ndamping = 1\ngain_db = 3', "damping goes with a lead-lag of"),
            ('"butterworth"\norder = 4', '"notch"\nwidth_hz = 150\ndepth_db = 9', "width_hz is 150; from 0.002 to"),
            ("sample_hz = 200", "sample_hz = 0", "sample_hz is 0; a number above 0 and of at most 1000000000 in Hz"),
            ("range = 16", "range = 0", "range is 0; a number above 0"),
            ('"poles"', '"poles"\ndepth = 3', "section[1]: key 'depth' is not known (did you mean depth_db?)"),
        ],
    ),
    "redundancy": (
        "examples/hexad.toml",
        "redundancy FILE",
        [
            ('range = "1/8"', 'range = "-1/8"', "range is '-1/8'; a number above 0 in rad or m/s is needed"),
            ('sensor = "gyro"', 'sensor = "gyros"', "sensor 'gyros' is not known (did you mean gyro?)"),
            ("[1, 0, 0]", '[1, 0, "x"]', "axes[1][3] is 'x': numbers"),
        ],
    ),
    "kalman": (
        "examples/kalman/gyrocompass.toml",
        "kalman FILE",
        [
            ("interval = 1", "interval = true", "schedule.interval is true; a number, or a text such as"),
            ("deviation = 0.05", "sigma = 0.05", "state[azimuth]: key 'sigma' is not known"),
            ("density", "densty", "noise.walk_north: key 'densty' is not known (did you mean density?)"),
        ],
    ),
    "calibration": (
        "examples/positions-20.toml",
        "study calibration FILE",
        [
            ("rate_sigma_deg_h", "rate_sigma_deg_s", "key 'rate_sigma_deg_s' is not known (did you mean"),
            ("[0, 1, 0]", "[0, 1]", "positions[1] has 2 entries; 3 are needed"),
            ("[0, 1, 0]", "[0, 2, 0]", "positions[1] has the length 2; 1 is needed"),
            ("positions = [", "pause_s = -1\npositions = [", "pause_s is -1; a whole number from 0 to 100000 in s"),
        ],
    ),
    "variants": (
        "examples/variants/strapgen.toml",
        "build",
        [
            ("max_rate_deg_s", "max_rate_rad_s", "key 'max_rate_rad_s' is not known (did you mean max_rate_deg_s"),
            ("sample_hz = 200", "sample_hz = 0", "variant.flight.sample_hz: --sample-hz is 0; a number above 0"),
            ("verify = true", "verify = 1", "variant.flight.checks.verify is 1; true or false is needed"),
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SCHEMAS)
def test_a_wrong_file_gets_one_line_and_status_2(kind, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    example, command, changes = WRONG[kind]
    text = (ROOT / example).read_text("utf-8")
    changes = [("\n", "\ncolour = 1\n", "key 'colour' is not known"), *changes]
    name = "strapgen.toml" if kind == "variants" else "wrong.toml"
    for old, new, said in changes:
        assert old in text, old
        Path(name).write_text(text.replace(old, new, 1), "utf-8")
        with pytest.raises(SystemExit) as stop:
            main(command.replace("FILE", name).split())
        told = capsys.readouterr()
        assert (stop.value.code, told.out, told.err.count("\n")) == (2, "", 1), told
        assert told.err.startswith(f"strapgen: {name}: ") and said in told.err
        assert [path.name for path in Path().iterdir()] == [name]


def test_a_limit_holds_as_its_decimal_digits():
    def parse(value: Any) -> Any:
        data = tomllib.loads(Path(ROOT / WRONG["loops"][0]).read_text("utf-8"), parse_float=str)
        return toml_models.parse(MODELS["loops"], data | {"cycle_s": value})

    assert parse("0.00001").cycle_s * 10**5 == 1  # the double nearest to 1e-5 is above it
    assert parse(1000).cycle_s == 1000
    for value in ("0.0000099", "1000.1"):
        with pytest.raises(InputError, match="a number from 1e-05 to 1000 in s is needed"):
            parse(value)
