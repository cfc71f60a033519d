"""Words of outputs: rounding within the part of the accuracy, angles that turn, and ends that hold."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.ir.exceptions import InputError
from strapgen.navigation.outputs import OUTPUT_WORDS

#: Bits with the sign for a rounding of a tenth of the printed accuracy.
BITS = {
    "roll": 15, "pitch": 15, "true_heading": 13, "magnetic_heading": 10, "body_acceleration": 12, "body_rate": 14,
    "ground_velocity": 12, "vertical_velocity": 14, "track_angle": 9, "drift_angle": 8, "flight_path_angle": 13,
    "track_acceleration": 9, "vertical_acceleration": 12, "track_angle_rate": 11,
}  # fmt: skip


def test_the_fewest_bits_meet_a_tenth_of_the_accuracy():
    assert {name: one.bits() for name, one in OUTPUT_WORDS.items() if one.accuracy is not None} == BITS
    for name, bits in BITS.items():
        one = OUTPUT_WORDS[name]
        assert one.quantum(bits) / 2 <= one.accuracy / 10 < one.quantum(bits)


@given(st.sampled_from(sorted(OUTPUT_WORDS)), st.fractions(-1000, 1000), st.integers(8, 24))
def test_a_value_comes_back_within_half_a_quantum(name, value, bits):
    one = OUTPUT_WORDS[name]
    word = one.encoded(value, bits)
    assert -(1 << (bits - 1)) <= word < 1 << (bits - 1)
    back = one.decoded(word, bits)
    if one.turns:
        apart = (back - value + one.range) % (2 * one.range) - one.range
        assert abs(apart) <= one.quantum(bits) / 2
    elif abs(value) <= one.range - one.quantum(bits):
        assert abs(back - value) <= one.quantum(bits) / 2
    else:
        assert abs(back) <= one.range and abs(back) >= min(abs(value), one.range) - one.quantum(bits)


def test_what_has_no_accuracy_or_no_bits_is_refused():
    with pytest.raises(InputError, match="no printed accuracy"):
        OUTPUT_WORDS["inertial_altitude"].bits()
    with pytest.raises(InputError, match="more than 32 bits"):
        OUTPUT_WORDS["roll"].bits(Fraction(1, 10**9))
    with pytest.raises(InputError, match="bits"):
        OUTPUT_WORDS["roll"].quantum(40)
