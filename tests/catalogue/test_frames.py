"""The frames of the catalogue: every vector and matrix states its own, and a feedback pair agrees in it."""

from __future__ import annotations

import pytest
from derived import kernel

from strapgen.catalogue import KERNELS, VECTORS, Choice, choose
from strapgen.ir.signals import Signal

#: Signals that have no frame, with the reason.
WITHOUT = {
    **dict.fromkeys(
        ("torque_increment", "compensated_torque_increment", "indicated_torque_increment"),
        "each element is about another torquer axis",
    ),
    **dict.fromkeys(("measurement", "excluded", "failed"), "there is one number for each redundant sensor"),
    **dict.fromkeys(
        ("parity", "parity_bias", "next_parity_bias", "corrected", "trip"),
        "there is one number for each parity equation",
    ),
    **dict.fromkeys(("mean", "next_mean"), "from the axes of one unit to those of another"),
    **dict.fromkeys(
        (
            *("state_jacobian", "increments_jacobian", "right_noise", "left_noise"),
            *(
                "rotation_by_rate",
                "velocity_by_rate",
                "velocity_by_force",
                "position_by_rate",
                "position_by_force",
            ),
            *(
                "covariance",
                *(f"next_{part}_by_{by}" for part in ("velocity", "position") for by in ("rate", "force")),
            ),
            *("next_rotation_by_rate", "next_covariance"),
            *("rotation_vector_by_increments", "sculling_by_increments", "sculling_by_velocity_increments"),
            *(
                f"{part}_change_by_{by}"
                for part in ("velocity", "position")
                for by in ("increments", "velocity_increments")
            ),
        ),
        "each element is the derivative of one number by another",
    ),
    "level_angles": "its axes, level with heading 0, are those of no other signal",
    **dict.fromkeys(("deviation", "next_deviation", "heating_gain"), "there is one number for each gyro"),
}
#: Kernels whose signals need no frame, with the reason.
FREE = {
    "interpolated-integral": "there is one number for each stamp, of any channel",
    "interpolated-mean": "there is one number for each stamp, of any channel",
    "median-3": "its limit is one number, and there is one for each unit that is off",
    "tuned-rotor-loop": "there is one number for each of the two axes of a rotor",
}
#: Words of a meaning that name the frame.
WORDS = {
    "body axes": "b",
    "navigation axes": "n",
    "reference axes": "n",
    "body to reference": "b to n",
}
EVERY = [
    *(choose(name) for name in KERNELS),
    *(choose(name, increments=count, previous=1) for name in VECTORS for count in (2, 3)),
    *(choose(name) for name in VECTORS),
    choose("euler"),
    choose("dcm", "rk4", rates=True),
]


def faults(choice: Choice) -> list[str]:
    """Return what is wrong with the frames of a kernel."""
    derived = kernel(choice)
    signals: dict[str, Signal] = {signal.name: signal for signal in derived.inputs}
    signals |= {stage.signal.name: stage.signal for stage in derived.outputs}
    wrong = [
        f"{choice.kernel}: {name}: frame {signal.frame!r}"
        for name, signal in signals.items()
        if (bool(signal.frame) != bool(signal.shape)) != (name in WITHOUT) and choice.kernel not in FREE
    ]
    for words, frame in WORDS.items():
        wrong += [
            f"{choice.kernel}: {name}: {words}, but frame {signal.frame!r}"
            for name, signal in signals.items()
            if words in signal.meaning
            and signal.frame != frame
            and (" to " in words) == (" to " in signal.frame)
        ]
    for state, output in derived.recursion.states if derived.recursion else ():
        pair = [(s.unit, s.frame, s.over, s.shape) for s in (signals[state], signals[output])]
        wrong += [f"{choice.kernel}: {state}, {output}: {pair}"] if pair[0] != pair[1] else []
    return wrong


@pytest.mark.long
def test_every_vector_states_its_frame_and_a_state_keeps_it():
    assert [fault for choice in EVERY for fault in faults(choice)] == []
    present = {signal.name for choice in EVERY for signal in kernel(choice).signals}
    assert set(WITHOUT) <= present
    assert set(FREE) <= {choice.kernel for choice in EVERY}


@pytest.mark.parametrize(
    ("name", "over"),
    [
        ("imu-compensate", {"increment", "velocity_increment"}),
        ("pulse-compensate", {"count"}),
        ("two-speed-fast-2", {"increment", "velocity_increment", "previous_increment"}),
        ("dcm-two-speed-slow-2", set()),  # sums that the slow cycle resets are values at its end
        ("navigation-velocity", set()),
        ("euler-update", {"rotation_vector"}),
        ("dcm-acceleration", set()),
        ("euler", {"increments"}),
    ],
)
def test_increments_are_over_a_cycle_and_sums_are_not(name, over):
    assert {signal.name for signal in kernel(choose(name)).inputs if signal.over == "cycle"} == over
