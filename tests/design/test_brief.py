"""Briefs: what one says, and one line for each of those that say what cannot be."""

import textwrap
from fractions import Fraction

import pytest

from strapgen.cli import main
from strapgen.design.brief import Line, LineEnvironment, read_brief
from strapgen.ir.exceptions import InputError

GOOD = """
max_rate_deg_s = 200
[vibration]
lines = [{ frequency_hz = 20, theta_x_rad = 3e-4, theta_y_rad = 2e-4, phase_rad = 1.5 }]
[gyro]
sample_hz = 200
pulse_arcsec = 0.5
bandwidth_hz = 80
damping = 0.7
[budget]
drift_deg_h = 1
[processor]
word = 16
"""


#: What is changed in a good brief, and what is said of it.
BAD = [
    ("max_rate_deg_s = 200", "", "max_rate_deg_s is missing; a number above 0 in deg/s is needed"),
    ("max_rate_deg_s = 200", "max_rate_deg_s = 0", "max_rate_deg_s is 0"),
    ("max_rate_deg_s = 200", "max_rate_deg_s = true", "max_rate_deg_s is true; a number above 0 in deg/s is needed"),
    ("max_rate_deg_s = 200", "max_rate = 200", "key 'max_rate' is not known"),
    ("max_rate_deg_s = 200", "max_rate_deg_s = inf", "max_rate_deg_s"),
    ("max_rate_deg_s = 200", "max_rate_deg_s = 200\nspeed = 3", "key 'speed' is not known"),
    ("sample_hz = 200\n", "", "gyro.sample_hz is missing"),
    ("sample_hz = 200", "sample_hz = -5", "gyro.sample_hz is -5"),
    ("sample_hz = 200", "sample_hz = 2e7", "a number above 0 and of at most 1000000 in"),
    ("sample_hz = 200", "sample_hz = [200]", "gyro.sample_hz is [200]; a number above 0"),
    ("sample_hz = 200", "sample_khz = 2", "gyro: key 'sample_khz' is not known (did you mean sample_hz?)"),
    ("damping = 0.7\n", "", "gyro.damping is missing; bandwidth_hz and damping go together"),
    ("bandwidth_hz = 80\n", "", "gyro.bandwidth_hz is missing"),
    ("damping = 0.7", "damping = 0", "gyro.damping is 0"),
    ("pulse_arcsec = 0.5", "pulse_arcsec = -1", "gyro.pulse_arcsec is -1; a number of at least 0 in arcsec is needed"),
    ("pulse_arcsec = 0.5", 'pulse_arcsec = "half"', "gyro.pulse_arcsec"),
    ("drift_deg_h = 1", "", "budget.drift_deg_h is missing"),
    ("drift_deg_h = 1", "drift_deg_h = 0", "budget.drift_deg_h is 0"),
    ("drift_deg_h = 1", "drift_deg_h = 1\nsoftware_share = 1.5", "software_share is 1.5; a number above 0 and"),
    ("drift_deg_h = 1", "drift_deg_h = 1\nover_s = 0", "budget.over_s is 0"),
    ("drift_deg_h = 1", "drift_deg_h = 1\nover_s = 1e9", "a number above 0 and of at most 1000000 in"),
    ("drift_deg_h = 1", "drift_deg_h = 1\nvelocity = 3", "budget: key 'velocity' is not known"),
    ("word = 16", "word = 24", "processor.word is 24; 16, 32 or 64 is needed"),
    ("word = 16", "word = true", "processor.word is true"),
    ("word = 16", 'word = 16\ncpu = "z80"', "processor.cpu 'z80' is not known"),
    ("word = 16", "word = 16\nbytes = 0", "processor.bytes is 0"),
    ("[processor]\nword = 16", "processor = 3", ""),
    ("lines = [{ frequency_hz = 20,", "lines = [{ frequency = 20,", "frequency"),
    ("frequency_hz = 20,", "frequency_hz = 0,", "vibration.lines[1].frequency_hz is 0"),
    ("theta_x_rad = 3e-4", "theta_x_rad = -3e-4", "vibration.lines[1].theta_x_rad is -0.0003"),
    ("lines = [", 'psd = "a.csv"\nlines = [', "vibration: the keys lines and psd are there; one of them is needed"),
    ("lines = [{ frequency_hz = 20, theta_x_rad = 3e-4, theta_y_rad = 2e-4, phase_rad = 1.5 }]", "lines = []",
     "vibration.lines has 0 entries; at least 1 are needed"),
    ("lines = [{ frequency_hz = 20, theta_x_rad = 3e-4, theta_y_rad = 2e-4, phase_rad = 1.5 }]", "psd = 3",
     "vibration.psd is 3; a text is needed"),
    ("lines = [{ frequency_hz = 20, theta_x_rad = 3e-4, theta_y_rad = 2e-4, phase_rad = 1.5 }]",
     'recording = "none.csv"', "none.csv"),
    ("[budget]", "[budget", "is not TOML"),
]  # fmt: skip


def written(tmp_path, text):
    path = tmp_path / "brief.toml"
    path.write_text(textwrap.dedent(text))
    return path


def test_a_brief_is_read_exactly(tmp_path):
    with pytest.warns(DeprecationWarning, match="gyro.bandwidth_hz is now gyro.response"):
        brief = read_brief(written(tmp_path, GOOD))
    assert brief.gyro.seen.words == "second-order:80:0.7" and brief.gyro.pulse_arcsec == Fraction(1, 2)
    assert brief.environment == LineEnvironment((Line(20.0, 3e-4, 2e-4, 1.5),))
    assert (brief.budget.over_s, brief.budget.software_share, brief.processor.word) == (3600, 0.1, 16)


@pytest.mark.parametrize(("before", "after", "said"), BAD)
def test_a_brief_that_cannot_be_is_refused_in_one_line(tmp_path, before, after, said):
    assert before in GOOD
    path = written(tmp_path, GOOD.replace(before, after))
    with pytest.raises(InputError) as refused:
        read_brief(path)
    message = str(refused.value)
    assert said in message and "\n" not in message and message.startswith(str(path))


def test_the_command_refuses_a_bad_brief_in_one_line_and_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cases = [
        *((GOOD.replace(before, after), said) for before, after, said in BAD[::12]),
        (GOOD + "# \x01", "is not TOML"),
        ("", "max_rate_deg_s is missing"),
        (GOOD + "#" * 100_000, "bytes"),
    ]
    command = ["design", "--generate", "firmware", "--results", "results.jsonl", "--out", "out.txt"]
    wrong = []
    for text, said in cases:
        path = written(tmp_path, text)
        with pytest.raises(SystemExit) as stop:
            main([*command, path.name])
        told = capsys.readouterr()
        files = {file.name for file in tmp_path.iterdir()}
        fine = stop.value.code == 2 and said in told.err and told.err.count("\n") == 1 and not told.out
        if not fine or files != {path.name}:
            wrong.append((text, stop.value.code, told, files))
    assert not wrong, wrong[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("missing.toml", "missing.toml"),
        (".", "."),
        ("brief.toml --method rk9", "method 'rk9' is not known"),
        ("brief.toml --method rk4:7", "method 'rk4:7' is not known"),
        ("brief.toml --simulate 0", "simulate is 0"),
        ("brief.toml --simulate few", "simulate is 'few'"),
        ("brief.toml --jobs 0", "jobs is 0"),
        ("brief.toml --cluster here", "cluster is 'here'"),
        ("brief.toml --out a --results a", "--out and --results are both a"),
        ("brief.toml --format xml", "format 'xml' is not known"),
    ],
)
def test_options_that_cannot_be_are_refused_in_one_line(words, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = written(tmp_path, GOOD)
    with pytest.raises(SystemExit) as stop:
        main(["design", *words.split()])
    told = capsys.readouterr().err
    assert stop.value.code == 2 and said in told and told.count("\n") == 1
    assert [*tmp_path.iterdir()] == [path]
