"""Forms of a written attitude beside those of SciPy, and trajectories as others read them."""

from __future__ import annotations

import io
import sys

import numpy as np
import pandas as pd
import polars as pl
import pyarrow.parquet as pq
import pytest
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from strapgen import backend
from strapgen.ir.exceptions import InputError, MissingExtraError
from strapgen.lab.recordings import attitude_output
from strapgen.lab.recordings.attitude_output import AttitudeForm
from strapgen.lab.recordings.recording import History, Recording, propagate

ALGORITHMS = ["euler", "dcm", "cayley-klein"]


@pytest.fixture(scope="module", params=ALGORITHMS)
def history(request) -> History:
    """A tumble of several turns."""
    time = np.arange(2000) * 0.01
    rates = np.stack([np.sin(time), 2 * np.cos(0.3 * time), np.full(2000, 0.7)], axis=1)
    return propagate(backend(request.param, "rk4", 2), Recording(3.0, 0.01, rates * 0.01))


@pytest.fixture(scope="module")
def expected(history) -> Rotation:
    """The nearest rotations; SciPy takes matrices that depart little from one as they are."""
    return Rotation.from_matrix([polar(matrix)[0] for matrix in history.matrices()])


def values(history: History, *arguments: str) -> np.ndarray:
    return np.column_stack([*AttitudeForm(*arguments).columns(history).values()])


@pytest.mark.parametrize("order", ["xyzs", "sxyz"])
@pytest.mark.parametrize("sense", ["body-to-reference", "reference-to-body"])
def test_quaternions_have_order_and_sense(history, expected, order, sense):
    q = values(history, "quaternion", order, sense)
    want = expected if sense == "body-to-reference" else expected.inv()
    found = Rotation.from_quat(q, scalar_first=order == "sxyz")
    assert (found * want.inv()).magnitude().max() < 1e-12
    assert np.linalg.norm(np.diff(q, axis=0), axis=1).max() < 0.1, "without jumps of sign"
    assert list(AttitudeForm("quaternion", order).columns(history)) == [f"q_{letter}" for letter in order]


def test_other_forms_are_those_of_scipy(history, expected):
    np.testing.assert_allclose(values(history, "rotation-vector"), expected.as_rotvec(), atol=1e-9)
    np.testing.assert_allclose(
        values(history, "rotation-vector", "xyzs", "reference-to-body"), -expected.as_rotvec(), atol=1e-9
    )
    np.testing.assert_allclose(values(history, "rpy"), expected.as_euler("xyz", degrees=True), atol=1e-9)
    C = values(history, "matrix").reshape(-1, 3, 3)
    np.testing.assert_allclose(C, history.matrices(), atol=0)
    turned = values(history, "matrix", "xyzs", "reference-to-body").reshape(-1, 3, 3)
    np.testing.assert_array_equal(turned, np.swapaxes(C, 1, 2))
    np.testing.assert_array_equal(values(history, "state"), history.states.reshape(len(C), -1))


def test_tum_is_read_as_time_position_quaternion(history, expected):
    rows = np.loadtxt(io.StringIO(attitude_output.tum(history)))
    np.testing.assert_array_equal(rows[:, 0], history.time)
    np.testing.assert_array_equal(rows[:, 1:4], 0)
    assert (Rotation.from_quat(rows[:, 4:]) * expected.inv()).magnitude().max() < 1e-12


def test_kitti_is_read_as_rows_of_a_pose(history, expected):
    poses = np.loadtxt(io.StringIO(attitude_output.kitti(history))).reshape(-1, 3, 4)
    np.testing.assert_array_equal(poses[:, :, :3], history.matrices())
    np.testing.assert_array_equal(poses[:, :, 3], 0)


def test_parquet_is_read_by_other_libraries(history):
    columns = {"time_s": history.time, **AttitudeForm("quaternion").columns(history)}
    content = attitude_output.parquet(columns)
    for table in (pq.read_table(io.BytesIO(content)).to_pydict(), pl.read_parquet(io.BytesIO(content))):
        for name, column in columns.items():
            np.testing.assert_array_equal(np.asarray(table[name]), column)


@pytest.mark.parametrize(("missing", "kind"), [((), pd.DataFrame), (("pandas",), pl.DataFrame)])
def test_data_frame_is_of_a_library_that_is_there(history, monkeypatch, missing, kind):
    for name in missing:
        monkeypatch.setitem(sys.modules, name, None)
    frame = history.to_frame("rpy")
    assert isinstance(frame, kind)
    assert list(frame.columns) == ["time_s", "roll_deg", "pitch_deg", "heading_deg"]
    np.testing.assert_array_equal(np.asarray(frame["time_s"]), history.time)


def test_missing_libraries_are_named(history, monkeypatch):
    for name in ("pandas", "polars", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtraError, match=r"^data frames need pandas, polars or pyarrow"):
        history.to_frame()
    with pytest.raises(MissingExtraError, match=r"^Parquet needs pyarrow: pip install 'strapgen\[logs\]'$"):
        attitude_output.parquet({"time_s": history.time})


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("euler",), "attitude 'euler' is not known"),
        (("quaternion", "wxyz"), "quaternion 'wxyz' is not known"),
        (("quaternion", "xyzs", "body"), "sense 'body' is not known"),
        (("rpy", "xyzs", "reference-to-body"), "roll, pitch and heading are those of the body"),
        (("state", "xyzs", "reference-to-body"), "a state is against the reference axes"),
    ],
)
def test_other_words_are_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        AttitudeForm(*arguments)


def test_states_that_are_no_attitude_are_refused():
    with pytest.raises(InputError, match=r"^the states are not known as attitudes"):
        History(np.zeros(2), np.zeros((2, 4)), 1.0, 0).to_frame()
