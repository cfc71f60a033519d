"""Signals: names and shapes agree, and plain data holds all of a signal."""

import json
from dataclasses import FrozenInstanceError
from fractions import Fraction

import pytest

from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import FRAMES, Signal, after


def test_a_matrix_names_its_elements_row_by_row():
    signal = Signal.matrix("attitude", "C")
    assert signal.shape == (3, 3)
    assert signal.elements == ("C_11", "C_12", "C_13", "C_21", "C_22", "C_23", "C_31", "C_32", "C_33")


@pytest.mark.parametrize(
    ("signal", "shape", "elements"),
    [
        (Signal.vector("rate", "w"), (3,), ("w_x", "w_y", "w_z")),
        (Signal.labelled("state", "e", "xyzs"), (4,), ("e_x", "e_y", "e_z", "e_s")),
        (Signal.scalar("time"), (), ("time",)),
    ],
)
def test_vectors_and_scalars_name_their_elements(signal, shape, elements):
    assert (signal.shape, signal.elements, signal.size) == (shape, elements, len(elements))


@pytest.mark.parametrize(("shape", "elements"), [((3,), ("a", "b")), ((), ()), ((2, 2), ("a", "b", "c"))])
def test_shape_and_elements_must_agree(shape, elements):
    with pytest.raises(ValueError, match="'rate'"):
        Signal("rate", shape, elements)


@pytest.mark.parametrize(
    "signal",
    [
        Signal.vector("rate", "w", unit="rad/s", meaning="body rate", bound=Fraction(1, 3)),
        Signal.matrix("attitude", "C", bound=Fraction(1), frame="b to n"),
        Signal.vector("increment", "d", unit="any", frame="any", over="cycle"),
        Signal.scalar("time", unit="s"),
    ],
)
def test_plain_data_holds_all_of_a_signal(signal):
    data = json.loads(json.dumps(signal.as_dict()))
    exact = data["bound"] and Fraction(data["bound"])  # 1/3 is no decimal
    rebuilt = data | {"shape": tuple(data["shape"]), "elements": tuple(data["elements"]), "bound": exact}
    assert Signal(**rebuilt) == signal


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"frame": "q"},
            "frame of rate 'q' is not known; allowed: b, n, e, i, g, any, or an attitude such as 'b to n'",
        ),
        ({"frame": "b to q"}, "frame of rate 'b to q' is not known"),
        ({"frame": "b to n to e"}, "frame of rate 'b to n to e' is not known"),
        ({"frame": "any to b"}, "frame of rate 'any to b' is not known"),
        ({"over": "step"}, "over of rate 'step' is not known; allowed: cycle, or nothing"),
    ],
)
def test_a_frame_is_one_of_the_table_or_leads_from_one_to_another(fields, words):
    with pytest.raises(InputError) as caught:
        Signal.vector("rate", "w", **fields)
    assert str(caught.value).startswith(words)
    for frame in (*FRAMES, "any", "b to n", "n to n", ""):
        assert Signal.vector("rate", "w", frame=frame).frame == frame


def test_a_state_after_a_call_has_unit_frame_and_cycle_of_the_state():
    state = Signal.vector("sum", "s", unit="rad", frame="b", over="cycle")
    assert (after(state).unit, after(state).frame, after(state).over) == ("rad", "b", "cycle")


def test_a_signal_does_not_change():
    with pytest.raises(FrozenInstanceError):
        Signal.scalar("time").unit = "s"
