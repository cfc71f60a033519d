"""Bad files of systems: one line on stderr that names the stage and the wire, exit 2, and nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import run
from navigation.described_files import ATTITUDE, TWO_SPEEDS

GYRO = "[inputs.gyro]\n"
FAST, SLOW, NAVIGATION = "every = 1\n", "every = 8\n", "every = 16\n"
#: A change of TWO_SPEEDS, and what the message says.
BAD = [
    # Inputs
    ("range = 0.001\n", "range = -1\n", "inputs.gyro.range is -1; a number above 0, or a text"),
    ("range = 0.001\n", 'range = "1/0"\n', "inputs.gyro.range is '1/0', which divides by 0"),
    (
        'frame = "n"',
        'frame = "q"',
        "inputs.earth.frame is 'q'; one of b, n, e, i, g, an attitude such as b to n",
    ),
    (
        'unit = "m/s"',
        'unit = "any"',
        "inputs.accelerometer.unit is 'any'; a unit, '1' for a pure number, is needed",
    ),
    (GYRO, f'[inputs.spare]\nunit = "1"\nrange = 1\n{GYRO}', "input spare is taken by no stage"),
    # Names
    ("gyro", "int", "input 'int' has a meaning in generated code; another name is needed"),
    ("gyro", "lambda", "input 'lambda' has a meaning in generated code"),
    ("gyro", "memory", "input 'memory' has a meaning in generated code"),
    ("gyro", "memcpy", "input 'memcpy' has a meaning in generated code"),
    ("gyro", "two_fast", "input 'two_fast' has a meaning in generated code"),
    ("gyro", "Gyro", "key of inputs is 'Gyro'; a name of at most 31 lower-case letters"),
    ('"navigation"', '"run"', "stage 'run' has a meaning in generated code"),
    ('name = "two"', 'name = "string"', "the name 'string' has a meaning in generated code"),
    (
        'name = "slow"',
        'name = "fast"',
        "the name 'fast' stands twice; every input and stage needs its own name",
    ),
    ('title = "Two', 'title = "*/Two', "title holds */, which has a meaning in generated code; leave it out"),
    # Wires
    (
        'increment = "gyro"',
        'increment = "gyr"',
        "stage fast: increment = 'gyr': input 'gyr' is not known (did you",
    ),
    (
        '"fast.coning"',
        '"fats.coning"',
        "stage slow: coning = 'fats.coning': stage 'fats' is not known (did you mean",
    ),
    (
        '"fast.coning"',
        '"fast.conin"',
        "stage slow: coning = 'fast.conin': value of stage fast 'conin' is not known",
    ),
    ('turn = "earth"', 'trun = "earth"', "'trun' is not known (did you mean turn?)"),
    (
        'turn = "earth"\n',
        "",
        "stage slow: turn is not wired; wire it to an input or a stage.output, or state a constant",
    ),
    ('frame = "n"', 'frame = "b"', "stage slow: turn = 'earth': frame b meets frame n"),
    ('unit = "m/s"', 'unit = "m"', "stage fast: velocity_increment = 'accelerometer': unit m meets unit m/s"),
    (
        'state = "slow.state"',
        'state = "slow.previous_turn"',
        "stage navigation: wires: state: shape (3,) meets shape",
    ),
    (
        'coning = "fast.coning"',
        'coning = "fast.angle_sum"',
        "stage fast: coning is a sum that no stage takes",
    ),
    # What goes back
    ('turn = "earth"', 'turn = "slow.navigation_rotation"', "comes from the stage itself; state its delay"),
    (
        SLOW,
        f"{SLOW}delay = {{ coning = 1 }}\n",
        "stage slow: delay of coning, which comes from the earlier stage fast",
    ),
    (SLOW, f"{SLOW}delay = {{ turn = 1 }}\n", "stage slow: delay of turn, which is an input of the system"),
    (
        SLOW,
        f"{SLOW}delay = {{ trun = 1 }}\n",
        "stage slow: delay: input of euler-two-speed-slow-2 'trun' is not known",
    ),
    (SLOW, f"{SLOW}delay = {{ state = 1 }}\n", "stage slow: delay of state, which is not wired"),
    (
        NAVIGATION,
        f"{NAVIGATION}delay = {{ state = 1 }}\n",
        "stage navigation: delay of state, which is the same memory",
    ),
    # Rates
    ("every = 16", "every = 12", "stage navigation: every 12 is no multiple of the 8 of slow; rates divide"),
    ("every = 16", "every = 4", "stage navigation (every 4) stands after slow (every 8)"),
    ("every = 1\n", "every = 2\n", "stage fast: every is 2; the fastest stage has 1, unless it collects"),
    ("every = 16", 'every = "7 Hz"', "stage[navigation].every is '7 Hz', which does not divide the 3200 Hz"),
    ("every = 16", 'every = "0 Hz"', "stage[navigation].every is '0 Hz'; a rate above 0 Hz is needed"),
    # Kernels
    (
        "two-speed-fast-2",
        "two-speed-fsat-2",
        "'two-speed-fsat-2' is not known (did you mean two-speed-fast-2",
    ),
    (FAST, f'{FAST}method = "rk4"\n', "stage fast: kernel two-speed-fast-2 takes no method (got rk4)"),
    (FAST, f"{FAST}constants = {{ coning = [0, 0, 0] }}\n", "coning is a state, which each call changes"),
    (
        SLOW,
        f"{SLOW}constants = {{ turn = [0, 0, 0] }}\n",
        "stage slow: turn is wired and stated as a constant",
    ),
    (
        SLOW,
        f"{SLOW}initial = {{ state = [0, 0, 1] }}\n",
        "stage slow: initial state has 3 numbers; 4 are needed",
    ),
    (
        SLOW,
        f"{SLOW}initial = {{ state = [0, 0, 0, 3] }}\n",
        "stage slow: initial state holds 3, beyond its range of 1",
    ),
    (
        NAVIGATION,
        f"{NAVIGATION}initial = {{ state = [0, 0, 0, 1] }}\n",
        "initial state is that of another stage",
    ),
    (
        NAVIGATION,
        f'{NAVIGATION}writes = {{ next = "slow.state" }}\n',
        "stage navigation: writes: next is the next state already",
    ),
    (
        NAVIGATION,
        f'{NAVIGATION}writes = {{ velocity_change = "fast.coning" }}\n',
        "stage navigation: writes: velocity_change = 'fast.coning': unit rad meets unit m/s",
    ),
    # The file
    (
        "sample_hz",
        'outputs = ["fast.none"]\nsample_hz',
        "outputs: fast.none: value of stage fast 'none' is not known",
    ),
    ("sample_hz", 'outputs = ["gyro"]\nsample_hz', "outputs: stage 'gyro' is not known; allowed: fast, slow"),
]
#: Changes of ATTITUDE.
BAD_STEPS = [
    (
        "increments = 2\nevery = 2",
        "increments = 2\nevery = 4",
        "a step takes 2 samples of every 1, so that its every is 2, not 4",
    ),
    (
        "delay = { state = 1 }\n",
        "",
        "stage turned: state = 'matrix.attitude' goes back from a later stage to an earlier",
    ),
    ('method = "rk4"', 'method = "rk44"', "stage step: method 'rk44' is not known"),
    ('"gyro"', '"force"', "stage step: increments = 'force': unit m/s^2 meets unit rad"),
    ("[0, 0, 1]]", "[0, 0]]", "stage matrix: initial attitude has 8 numbers; 9 are needed"),
]
#: Stages that are added at the end of TWO_SPEEDS.
ADDED = [
    (
        'name = "late"\nkernel = "sum-3"\nevery = 16\nwires = { increment = "gyro" }\nranges = { sum = 1 }',
        "stage late: increment = 'gyro': increments of every 1 meet a stage of every 16; sum-3 sums them up",
    ),
    (
        'name = "late"\nkernel = "sum-3"\nevery = 16\nwires = { increment = "navigation.velocity_change" }\n'
        '[[stage]]\nname = "later"\nkernel = "hold-3"\nevery = 16\nconstants = { share = 1 }\n'
        'wires = { increment = "late.sum" }',
        "stage late: the range of sum is missing; state it under ranges",
    ),
    (
        'name = "late"\nkernel = "sum-3"\nevery = 16\nwires = { increment = "fast.coning" }\nranges = { sum = 1 }',
        "a sum that is cleared every 8 cycles is taken every 16 too",
    ),
]


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Return the one line with which the command refuses its words."""
    run(["system", *words], 2)
    said = capsys.readouterr()
    assert not said.out
    assert said.err.count("\n") == 1
    assert said.err.startswith("strapgen: ")
    return said.err


def check(folder: Path, text: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that a file is refused with a message that begins with its name, and that nothing is written."""
    path = folder / "case.toml"
    path.write_text(text)
    out, drawing = folder / "out", folder / "case.svg"
    said = refused([str(path), "--target", "numpy", "--out", str(out), "--draw", str(drawing)], capsys)
    assert said.startswith(f"strapgen: {path}")
    assert message in said
    assert sorted(folder.iterdir()) == [path]


@pytest.mark.parametrize(
    "text, old, new, message",
    [*((TWO_SPEEDS, *case) for case in BAD), *((ATTITUDE, *case) for case in BAD_STEPS)],
)
def test_a_file_with_one_error_is_refused_in_one_line(text, old, new, message, tmp_path, capsys):
    assert old in text
    check(tmp_path, text.replace(old, new), message, capsys)


@pytest.mark.parametrize("stage, message", ADDED)
def test_a_stage_that_does_not_fit_is_refused_in_one_line(stage, message, tmp_path, capsys):
    check(tmp_path, f"{TWO_SPEEDS}\n[[stage]]\n{stage}\n", message, capsys)


@pytest.mark.parametrize(
    "words, message",
    [
        ("nowhere.toml", "nowhere.toml cannot be read (No such file or directory)"),
        ("two-speed-dmc", "system 'two-speed-dmc' is not known (did you mean two-speed-dcm"),
        ("a*/b.toml", "FILE holds */"),
        (
            "case.toml --target rust",
            "target 'rust' is not known; allowed: numpy, c, c-float, c-fixed, fixed-model",
        ),
        (
            "case.toml --word 16",
            "the options of fixed point go with --target c-fixed or fixed-model, not with c",
        ),
        (
            "case.toml --target numpy --out o --with-runs",
            "--with-runs goes with targets in C, not with numpy",
        ),
        ("case.toml --with-runs", "--with-runs needs --out"),
        ("case.toml --check", "--check needs --out"),
        ("case.toml --force", "--force needs --out"),
        ("case.toml --draw case.png", "--draw case.png is no SVG file"),
        ("case.svg --draw ./case.svg", "--draw case.svg is the file that the command reads"),
        ("case.toml --out o --check --draw o.svg", "--check writes nothing; --draw does not go with it"),
        ("case.toml --sample-hz 0", "--sample-hz is 0; a number above 0 is needed"),
        ("case.toml --target numpy --cpu cortex-m3", "--cpu goes with targets in C, not with numpy"),
        ("case.toml --cpu z80", "cpu 'z80' is not known"),
    ],
)
def test_words_that_do_not_go_together_are_refused_in_one_line(words, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("case.toml").write_text(TWO_SPEEDS)
    assert message in refused(words.split(), capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["case.toml"]
