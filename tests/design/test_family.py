"""Families of filters: what is designed, written, read again and the same every time."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.analysis.vibration.spectrum import Spectrum
from strapgen.catalogue.methods import windows
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.design import family
from strapgen.design.family import FamilyBrief, design
from strapgen.design.filters import responses
from strapgen.design.filters.band_grid import BITS, ONE
from strapgen.ir.exceptions import InputError
from strapgen.lab.runs import drift

GYRO = Response(frequency_hz=Fraction(40), damping=Fraction(7071, 10000), sample_hz=Fraction(100))
SMALL = FamilyBrief(2, 2, Fraction(1), conditions=3, degree=2)

BRIEFS = {
    "minimax": SMALL,
    "noise": replace(
        SMALL, noise=Fraction(1, 1000), one_sided_noise=Fraction(0), start_noise=Fraction(1, 10)
    ),
    "more before": replace(SMALL, previous=3, ahead=1),
    "more ahead": replace(SMALL, previous=0, ahead=3),
    "none ahead": replace(SMALL, previous=3, ahead=0),
    "exact": replace(SMALL, rotation="exact", terms=20, title="Exact 7"),
    "two samples": replace(SMALL, increments=2, rotation="exact"),
    "three samples, more before": replace(SMALL, previous=3, ahead=1, increments=3, rotation="exact"),
    "gyro": pytest.param(
        replace(SMALL, gyro=GYRO, noise=Fraction(1, 10**6)),
    ),
    "gyro, minimax": pytest.param(replace(SMALL, gyro=GYRO), marks=pytest.mark.long),
}


@pytest.mark.long
@pytest.mark.parametrize("brief", BRIEFS.values(), ids=BRIEFS)
def test_written_files_are_read_back(brief, tmp_path):
    window = design(brief)
    (tmp_path / "w.toml").write_text(family.written(window, "a command"))
    again = windows.read(tmp_path / "w.toml")
    assert again == window
    assert (again.conditions, again.degree, again.gyro) == (3, 2, brief.gyro)
    assert (again.rotation, again.noise) == (brief.rotation, brief.noise)
    assert again.parity == (brief.previous == brief.ahead and brief.gyro is None)
    sizes = [(one.previous, one.ahead) for one in again.one_sided]
    assert sizes == windows.one_sided_sizes(brief.previous, brief.ahead)
    assert {one.noise for one in again.one_sided} <= {brief.one_sided_noise}
    assert [(one.previous, one.ahead, one.noise) for one in again.start] == [
        (*size, brief.start_noise) for size in windows.start_sizes(brief.previous, brief.ahead)
    ]
    assert {one.objective for one in again.one_sided} <= {"mean square"}
    assert again.objective == ("mean square" if brief.noise else "minimax")


@pytest.mark.long
def test_noise_makes_the_filters_smaller():
    quiet, noisy = (design(replace(SMALL, noise=noise)) for noise in (Fraction(0), Fraction(1, 10)))
    for m in (1, 2):
        assert sum(tap**2 for tap in noisy.filters[m]) < sum(tap**2 for tap in quiet.filters[m])


def test_a_spectrum_is_the_density_of_the_rate():
    # An angle of density f^-2 has a rate of flat density; the line at 10 to 11 Hz of 100 is all there is of the other.
    flat = Spectrum(lambda f: f**-2.0, {"angle_x": np.ones_like, "angle_y": np.ones_like}, (1e-4, 50.0))
    assert {weight / ONE for weight in responses.weights(flat, Fraction(1), Fraction(100))} == {1.0}
    line = Spectrum(np.ones_like, {"angle_y": np.ones_like}, (10.0, 11.0))
    weights = responses.weights(line, Fraction(1), Fraction(100))
    b = np.cos(np.pi * (np.arange(400) + 0.5) / 800)
    inside = (b > 0.2 * np.pi) & (b < 0.22 * np.pi)
    expected = b**2 * inside / np.mean(b**2 * inside)
    # Weights are rounded to 2^-30.
    np.testing.assert_allclose([weight / ONE for weight in weights], expected, atol=2**-30)
    assert all(weight % (1 << (BITS - 30)) == 0 for weight in weights)


@pytest.mark.parametrize(
    ("spectrum", "message"),
    [
        (Spectrum(np.ones_like, {"acceleration_x": np.ones_like}, (1.0, 2.0)), "the spectrum turns nothing"),
        (
            Spectrum(np.ones_like, {"angle_x": np.ones_like}, (40.0, 50.0)),
            "has no motion below 1 rad a sample",
        ),
    ],
)
def test_a_spectrum_without_rate_is_refused(spectrum, message):
    with pytest.raises(InputError, match=message):
        responses.weights(spectrum, Fraction(1), Fraction(100))


def test_more_conditions_than_samples_are_refused():
    with pytest.raises(InputError, match=r"^conditions is 4; a whole number from 1 to 3 is needed$"):
        FamilyBrief(previous=1, ahead=1, band=Fraction(1, 2))


def test_numbers_of_a_file_are_exact():
    for value in (Fraction(1, 3), Fraction(13, 10), Fraction(-1, 2**13), Fraction(10**14), Fraction(0)):
        assert Fraction(family.number(value)) == value


@pytest.mark.long
def test_a_single_sample_is_a_window_too():
    window = design(FamilyBrief(0, 0, Fraction(1), conditions=1, degree=2))
    assert window.filters[:2] == ((1,), (0,)) and not window.one_sided + window.start


def test_several_samples_take_the_exact_rotation():
    with pytest.raises(InputError, match=r"^rotation is 'fourth'; steps of 2 samples take the exact one$"):
        replace(SMALL, increments=2)


@pytest.mark.long
def test_step_of_two_samples_integrates_its_band():
    # 1+7+7 has 6.5e-6 deg/h there, and a polynomial through 3+3 samples 0.4.
    brief = FamilyBrief(7, 7, Fraction(13, 10), increments=2, rotation="exact", terms=12)
    window = replace(design(brief), file="designed here")
    assert window.parity
    cone = strapgen.motion("cone", half_angle_deg=1, frequency_hz=10)
    run = strapgen.simulate(strapgen.backend("euler", window, backend="c"), cone, Fraction(1, 50), 60)
    assert drift(run) < 1e-6


def test_a_symmetric_window_of_two_samples_is_its_filters():
    # A tap that is off by 1e-30 takes the symmetry away, and with it the sums and differences of samples.
    brief = replace(SMALL, increments=2, rotation="exact", terms=2)
    window = replace(design(brief), file="designed here")
    first, *others = window.filters
    uneven = replace(
        window, filters=(first, (others[0][0] + Fraction(1, 10**30), *others[0][1:]), *others[1:])
    )
    assert window.parity and not uneven.parity
    samples = strapgen.motion("random", rate_deg_s=200).samples(Fraction(1, 100), 0, window.total_increments)
    steps = [strapgen.backend("euler", one) for one in (window, uneven)]
    ends = [step.step(step.identity, samples) for step in steps]
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-15)


def test_titles_name_the_purpose_of_filters():
    assert replace(SMALL, gyro=GYRO, noise=Fraction(1, 100), spectrum=()).full_title == (
        "Window 1+2+2 to 1 rad, gyro 40 Hz, noise 0.01, for a spectrum"
    )


def test_a_second_design_takes_its_filters_from_the_cache(monkeypatch):
    brief = FamilyBrief(2, 2, Fraction(1), degree=2)
    first = design(brief)
    asked = []

    def designed(*of: object) -> tuple[()]:
        asked.append(of)
        raise InputError("designed again")

    monkeypatch.setattr(family, "_designed", designed)
    again = design(replace(brief, title="By another name"))
    assert [again.filters, *(one.filters for one in again.one_sided)] == [
        first.filters,
        *(one.filters for one in first.one_sided),
    ]
    assert not asked
    for other in (replace(brief, band=Fraction(3, 2)), replace(brief, one_sided_noise=Fraction(1, 100))):
        with pytest.raises(InputError, match="designed again"):
            design(other)
