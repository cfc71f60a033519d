"""Filters of windows: the built-in files, their conditions, and every way in which a user's file can be wrong."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
import sympy as sp

from strapgen.catalogue.methods import sensor_response, window_conditions, windows
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.windows import WINDOW_TITLES, WINDOWS, read, verify
from strapgen.ir.exceptions import InputError
from strapgen.storage import resources

FOLDER = Path(windows.__file__).parent / "window_filters"
FAMILIES = pytest.mark.parametrize("name", WINDOW_TITLES)
GYRO = Response(frequency_hz=Fraction(40), damping=Fraction(7071, 10000), sample_hz=Fraction(100))


# The built-in files


def test_the_catalogue_lists_every_family_with_its_one_sided_filters():
    names = ["window-3-3", "window-5-5", "window-7-7", "window-9-9"]
    pairs = ["pair-1-5", "pair-1-7", "pair-1-8", "pair-1-9", "pair-2-5", "pair-2-7"]
    assert list(WINDOW_TITLES) == names + pairs
    assert {path.stem for path in FOLDER.iterdir()} == set(WINDOW_TITLES)
    assert {"window-14-0", "window-0-14", "window-8-6", "window-6-8", "pair-1-8-16-0"} < set(WINDOWS)
    sides = [int(name.rpartition("-")[2]) for name in WINDOW_TITLES]
    assert len(list(WINDOWS)) == len(WINDOWS) == sum(2 * side + 1 for side in sides) == 140
    with pytest.raises(KeyError):
        WINDOWS["window-8-7"]


def test_the_catalogue_is_lazy_and_needs_no_computer_algebra():
    code = (
        "import sys; sys.modules['sympy'] = None;"
        "from strapgen.catalogue.methods import windows;"
        "print(len(windows.WINDOWS), windows._shipped_family.cache_info().currsize);"
        "windows.verify(windows.WINDOWS['window-7-7']); print(windows._shipped_family.cache_info().currsize)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.split() == ["140", "0", "1"]


@FAMILIES
def test_a_file_is_one_that_a_user_could_hand_over(name):
    verified, built_in = read(FOLDER / f"{name}.toml"), WINDOWS[name]
    assert verified.filters == built_in.filters and verified.title == built_in.title == WINDOW_TITLES[name]
    assert verified.name not in WINDOWS and verified.file.endswith(f"{name}.toml")
    for ours, theirs in ((verified.one_sided, built_in.one_sided), (verified.start, built_in.start)):
        assert [one.filters for one in ours] == [one.filters for one in theirs]


@FAMILIES
def test_filters_have_their_parity_and_their_sizes(name):
    window = WINDOWS[name]
    half = window.previous
    pair = name.startswith("pair")
    increments = int(name.split("-")[1]) if pair else 1
    assert window.parity and (window.ahead, window.increments) == (half, increments)
    sizes = [(one.previous, one.ahead) for one in window.one_sided]
    assert sizes == [(2 * half - k, k) for k in reversed(range(half))] + [
        (k, 2 * half - k) for k in range(half)
    ]
    for one in window.one_sided:
        assert window.one_sided_with(one.ahead) is one and WINDOWS[one.name] == one
        assert one.name == f"{name if pair else 'window'}-{one.previous}-{one.ahead}"
        assert (one.form, one.rotation == "exact") == ("legendre", increments > 1 or name == "window-9-9")
        assert one.mirrored().filters == window.one_sided_with(one.previous).filters and not one.parity
    assert [(one.previous, one.ahead, one.noise) for one in window.start] == [
        (k, 2 * half - k, 0) for k in range(half)
    ]
    assert window.one_sided_with(half) is window
    assert window.mirrored() == replace(window, one_sided=(), start=())
    with pytest.raises(InputError, match="has no filters with 99 of its samples ahead"):
        window.one_sided_with(99)


@pytest.mark.long
@FAMILIES
def test_a_wrong_digit_is_seen(name):
    window, off = WINDOWS[name], Fraction(1, 10**30)
    for one in (window, window.one_sided[0], window.one_sided[-1]):
        for m in range(1, len(one.filters)):
            row = one.filters[m]
            wrong = (*one.filters[:m], (row[0] + off, *row[1:]), *one.filters[m + 1 :])
            with pytest.raises(InputError, match=rf"^the filter of c_{m} gives .* on the rate u\^0, "):
                verify(replace(one, filters=wrong, one_sided=()))
    with pytest.raises(InputError, match="filters row 1, of c_0, is the sum of the step's samples"):
        verify(replace(window, filters=(window.filters[1], *window.filters[1:])))


def test_a_wrong_one_sided_filter_is_named():
    window = WINDOWS["window-3-3"]
    one = window.one_sided[1]
    wrong = replace(one, filters=(one.filters[0], one.filters[2], *one.filters[2:]))
    with pytest.raises(
        InputError, match=r"^5 before and 1 ahead: the filter of c_1 gives 0 on the rate u\^1, 1/2"
    ):
        verify(replace(window, one_sided=(window.one_sided[0], wrong)))


def integral(polynomial: list[Fraction], low: int | Fraction, high: int | Fraction) -> Fraction:
    """Return the integral of a polynomial, the constant coefficient first."""
    return sum(
        (
            c * (Fraction(high) ** (k + 1) - Fraction(low) ** (k + 1)) / (k + 1)
            for k, c in enumerate(polynomial)
        ),
        Fraction(0),
    )


def shifted_legendre(m: int) -> list[Fraction]:
    """Return P_m(2 tau - 1) by SymPy."""
    tau = sp.Symbol("tau")
    return [Fraction(int(c)) for c in reversed(sp.Poly(sp.legendre(m, 2 * tau - 1), tau).all_coeffs())]


def product(first: list[Fraction], second: list[Fraction]) -> list[Fraction]:
    result = [Fraction(0)] * (len(first) + len(second) - 1)
    for i, a in enumerate(first):
        for k, b in enumerate(second):
            result[i + k] += a * b
    return result


@pytest.mark.parametrize(("name", "degree"), [("window-3-3", 3), ("window-7-7", 3), ("window-9-9", 6)])
def test_a_polynomial_rate_gives_its_legendre_coefficients(name, degree):
    # c_m = (2m + 1) int_0^1 w(tau) P_m(2 tau - 1) dtau; a rate of two degrees more is not exact for any filter.
    for window in (WINDOWS[name], WINDOWS[name].one_sided[-1], WINDOWS[name].one_sided[0]):
        for highest in (degree, degree + 2):
            rate = [Fraction(k + 2, 2 * k + 3) for k in range(highest + 1)]
            angles = [integral(rate, j, j + 1) for j in range(-window.previous, window.ahead + 1)]
            for m, row in enumerate(window.filters[1:], 1):
                computed = sum(tap * angle for tap, angle in zip(row, angles, strict=True))
                true = (2 * m + 1) * integral(product(rate, shifted_legendre(m)), 0, 1)
                assert (computed == true) == (highest == degree), (window.name, m)


# Conditions


def test_conditions_of_a_step_of_several_samples_are_those_of_its_legendre_coefficients():
    # The sum of the step's samples is c_0 of any rate; the last polynomial of the step is fixed by its own samples.
    for number in (1, 2, 3):
        rows = window_conditions.increments((number, 2, 1), 5)
        for k, row in enumerate(rows):
            assert sum(row[2 : 2 + number]) == window_conditions.coefficients(0, 5)[k]
    assert [row[2:4] for row in window_conditions.increments((2, 2, 1), 3)] == [
        (Fraction(1, 2), Fraction(1, 2)),
        (Fraction(-1, 8), Fraction(1, 8)),
        (Fraction(1, 24), Fraction(1, 24)),
    ]


def test_legendre_coefficients_of_powers_are_those_of_sympy():
    power = [Fraction(1)]
    for k in range(8):
        for m in range(7):
            value = (2 * m + 1) * integral(product(power, shifted_legendre(m)), 0, 1)
            assert window_conditions.coefficients(m, 8)[k] == value
        power = product(power, [Fraction(-1, 2), Fraction(1)])


@pytest.mark.long
def test_a_gyro_shows_the_polynomial_that_its_equation_has_for_solution():
    # y + 2 zeta y'/w + y''/w^2 = t^k has one polynomial solution; its increments are the row.
    t = sp.Symbol("t")
    inverse = sp.Rational(GYRO.sample_hz / (2 * sensor_response.PI * GYRO.frequency_hz))
    damping = sp.Rational(GYRO.damping)
    rows = window_conditions.increments((1, 2, 3), 5, GYRO)
    for k, row in enumerate(rows):
        unknown = sp.symbols(f"a0:{k + 1}")
        y = sum(a * t**i for i, a in enumerate(unknown))
        equation = sp.expand(y + 2 * damping * inverse * y.diff(t) + inverse**2 * y.diff(t, 2) - t**k)
        solution = y.subs(sp.solve(sp.Poly(equation, t).all_coeffs(), unknown, dict=True)[0])
        half = sp.Rational(1, 2)
        integrals = [sp.integrate(solution, (t, j - half, j + half)) for j in range(-2, 4)]
        assert [sp.Rational(value) for value in row] == integrals


def test_pi_is_that_of_double_precision():
    assert abs(sensor_response.PI - Fraction(str(sp.pi.evalf(40)))) < Fraction(1, 10**16)


def test_a_window_for_a_gyro_has_no_mirror_image():
    with pytest.raises(InputError, match="is designed for a gyro; it has no mirror image"):
        replace(WINDOWS["window-3-3"], gyro=GYRO).mirrored()


def test_conditions_that_determine_nothing_are_refused():
    with pytest.raises(InputError, match="do not determine their taps"):
        window_conditions.inner_taps(
            [(Fraction(1), Fraction(1)), (Fraction(2), Fraction(2))], [Fraction(1)] * 2
        )


def test_generated_code_depends_on_the_files():
    assert set(FOLDER.iterdir()) <= set(resources.package_files())


# A user's file

#: Two samples of one side, and the line through the samples: it is exact for linear rates.
SMALL = {
    "name": '"Small window"',
    "source": '"by hand"',
    "previous": "1",
    "ahead": "1",
    "conditions": "2",
    "band": '"0.5"',
    "objective": '"minimax"',
    "filters": '[[0, 1, 0], ["-1/4", 0, "0.25"]]',
    "one_sided": '[{previous = 2, ahead = 0, objective = "mean square", filters = [[0, 0, 1], [0, "-1/2", "1/2"]]}]',
}


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return a function that writes a small family with some keys changed, or left out where None."""
    monkeypatch.chdir(tmp_path)

    def write(**changes: str | None) -> str:
        lines = [f"{key} = {value}" for key, value in (SMALL | changes).items() if value is not None]
        Path("mine.toml").write_text("\n".join(lines))
        return "mine.toml"

    return write


def test_a_file_is_read_and_named_after_its_title(written):
    window = read(written())
    half = Fraction(1, 2)
    assert (window.name, window.title, window.file) == ("small-window", "Small window", "mine.toml")
    assert (window.rotation, window.terms, window.noise, window.gyro) == ("fourth", 16, 0, None)
    assert window.filters[1] == (-half / 2, 0, half / 2) and window.parity
    now, first = window.one_sided
    assert (now.name, now.title) == ("small-window-2-0", "Small window; 2 samples before, 0 ahead")
    assert (first.name, first.filters[1]) == ("small-window-0-2", (-half, half, 0))
    assert now.file == "mine.toml" and (now.objective, window.objective) == ("mean square", "minimax")


def test_gyro_series_is_the_inverse_of_its_denominator():
    """The product with 1 + 2 zeta s/w + s^2/w^2 is the series of a sample's integral alone, exactly."""
    terms, inverse = 9, GYRO.sample_hz / (2 * sensor_response.PI * GYRO.frequency_hz)
    denominator = [Fraction(1), 2 * GYRO.damping * inverse, inverse**2]
    series = GYRO.series(terms)
    product = [sum(d * series[n - k] for k, d in enumerate(denominator[: n + 1])) for n in range(terms)]
    assert product == Response().series(terms)


def test_a_gyro_needs_filters_for_both_sides(written):
    # c_0 of a gyro: its lag 2 zeta/w, times the slope of the rate, is added again.
    gyro = "{bandwidth_hz = 40, damping = '0.7071', sample_hz = 100}"
    lag = -GYRO.series(2)[1]
    row = f'["{-lag / 2}", 1, "{lag / 2}"]'
    filters = f'[{row}, ["-1/4", 0, "1/4"]]'
    with pytest.raises(InputError, match="one_sided lacks the filters with 2 samples before and 0 ahead"):
        read(written(gyro=gyro, filters=filters, one_sided="[]"))
    sides = ", ".join(
        f'{{previous = {p}, ahead = {2 - p}, objective = "mean square", filters = {f}}}'
        for p, f in (
            (2, f'[[0, "{-lag}", "{1 + lag}"], [0, "-1/2", "1/2"]]'),
            (0, f'[["{1 - lag}", "{lag}", 0], ["-1/2", "1/2", 0]]'),
        )
    )
    window = read(written(gyro=gyro, filters=filters, one_sided=f"[{sides}]"))
    assert window.gyro == GYRO and [one.gyro for one in window.one_sided] == [GYRO, GYRO]
    with pytest.raises(InputError, match=r"mine.toml: the filter of c_0 gives .* on the rate u\^1"):
        read(written(gyro=gyro, one_sided=f"[{sides}]"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": None}, "name is missing; a text that begins with a letter"),
        ({"colour": "1"}, "key 'colour' is not known; allowed: name"),
        (
            {"name": '"window 3 3"'},
            "name 'window 3 3' is that of the method window-3-3; another one is needed",
        ),
        (
            {"name": '"7 samples"'},
            "name is '7 samples'; a text that begins with a letter from a to z is needed",
        ),
        ({"source": '""'}, "source is ''; a text that is not empty"),
        ({"previous": "-1"}, "previous is -1; a whole number from 0 to 40 is needed"),
        ({"ahead": "40"}, "the window has 42 samples; at most 41 are allowed"),
        ({"ahead": "2"}, "filters[1] has 3 taps; as many as samples are needed: 4"),
        ({"increments": "0"}, "increments is 0"),
        ({"conditions": "4"}, "conditions is 4; a whole number from 1 to 3 is needed"),
        ({"band": '"0"'}, "band is '0'; a number above 0 and below 3 in rad a sample is needed"),
        ({"band": "3.0"}, "band is 3.0; a number above 0 and below 3 in rad a sample is needed"),
        ({"band": '"sqrt(2)"'}, "band is 'sqrt(2)'; a rational number is needed"),
        ({"objective": '"best"'}, "objective 'best' is not known; allowed: minimax, mean square"),
        ({"rotation": '"second"'}, "rotation 'second' is not known; allowed: fourth, exact"),
        ({"terms": "99"}, "terms is 99; a whole number from 1 to 40 is needed"),
        ({"noise": '"-1"'}, "noise is '-1'; a number of at least 0 is needed"),
        ({"filters": "3"}, "filters is 3; a list of 2 to 9 lists is needed"),
        ({"filters": "[[0, 1, 0]]"}, "filters has 1 entry; from 2 to 9 are needed"),
        ({"filters": "[[0, 1, 0], 3]"}, "filters[2] is 3; a list of numbers is needed"),
        ({"filters": '[[0, 1, 0], ["a", 0, 0]]'}, "filters[2][1] is 'a'"),
        (
            {"filters": '[[0, 1, 0], ["-1/4", 0, "1/2"]]'},
            "the filter of c_1 gives 1/4 on the rate u^0, 0 is needed",
        ),
        (
            {"filters": '[[1, 0, 0], ["-1/4", 0, "1/4"]]'},
            "filters row 1, of c_0, is the sum of the step's samples",
        ),
        ({"gyro": "3"}, "gyro is 3; a table with filter, order, frequency_hz, damping"),
        ({"gyro": "{damping = 1}"}, "gyro.frequency_hz is missing; a filter second-order has frequency_hz"),
        ({"gyro": "{filter = 'bessel', order = 3, frequency_hz = 9}"}, "gyro.sample_hz is missing"),
        (
            {"gyro": "{bandwidth_hz = 40, damping = 0, sample_hz = 100}"},
            "gyro.damping is 0; a number above 0",
        ),
        ({"one_sided": "[3]"}, "one_sided[1] is 3; a table with previous, ahead"),
        ({"one_sided": "[]"}, "one_sided lacks the filters with 2 samples before and 0 ahead"),
        ({"one_sided": "[{previous = 2}]"}, "one_sided[1].ahead is missing"),
        (
            {"one_sided": SMALL["one_sided"].replace("previous = 2, ahead = 0", "previous = 1, ahead = 1")},
            "one_sided[1]: 1 sample before and 1 ahead are not among those for 3 samples",
        ),
        (
            {"one_sided": f"[{SMALL['one_sided'][1:-1]}, {SMALL['one_sided'][1:-1]}]"},
            "one_sided[2]: 2 samples before and 0 ahead are there twice",
        ),
        (
            {"one_sided": SMALL["one_sided"].replace('"1/2"', '"1/3"')},
            "2 before and 0 ahead: the filter of c_1 gives -1/6 on the rate u^0, 0 is needed",
        ),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(changes, message, written):
    with pytest.raises(InputError) as error:
        read(written(**changes))
    assert str(error.value).startswith("mine.toml: ") and message in str(error.value)
    assert "\n" not in str(error.value)
