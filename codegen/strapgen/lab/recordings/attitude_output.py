"""Forms in which the attitude along a recording is written, as columns with their units and as trajectories."""

from __future__ import annotations

import importlib
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, MissingExtraError
from strapgen.lab.recordings import quaternions
from strapgen.lab.recordings.attitude_names import FORMS, QUATERNIONS, SENSES

if TYPE_CHECKING:
    from strapgen.lab.recordings.recording import History

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AttitudeForm:
    """The form of a written attitude."""

    #: A key of `FORMS`
    form: str = "state"
    #: Order of a quaternion
    quaternion: str = "xyzs"
    sense: str = "body-to-reference"

    def __post_init__(self) -> None:
        checks.choice("attitude", self.form, FORMS)
        checks.choice("quaternion", self.quaternion, QUATERNIONS)
        checks.choice("sense", self.sense, SENSES)
        if self.sense != SENSES[0] and self.form in ("rpy", "state"):
            what = "roll, pitch and heading are those of the body" if self.form == "rpy" else "a state is"
            raise InputError(
                f"sense {self.sense}: {what} against the reference axes; a quaternion, matrix or rotation-vector has "
                "both senses"
            )

    def columns(self, history: History) -> dict[str, Array]:
        """Return the elements of the attitude by name, (N,) each, without the time."""
        if self.form == "state":
            states = history.states.reshape(len(history.time), -1)
            names = history.elements or [f"state_{k}" for k in range(1, 1 + states.shape[1])]
            return dict(zip(names, states.T, strict=True))
        turned = self.sense != SENSES[0]
        if self.form == "matrix":
            C = np.swapaxes(history.matrices(), -1, -2) if turned else history.matrices()
            names = [f"C_{row}{column}" for row in "123" for column in "123"]
            return dict(zip(names, C.reshape(-1, 9).T, strict=True))
        q = attitude_of(history)
        if self.form == "rpy":
            angles = np.degrees(roll_pitch_heading(q))
            return dict(zip(("roll_deg", "pitch_deg", "heading_deg"), angles.T, strict=True))
        q = quaternions.inverse(q) if turned else q
        if self.form == "rotation-vector":
            return dict(zip(("x_rad", "y_rad", "z_rad"), quaternions.rotation_vectors(q).T, strict=True))
        return {f"q_{element}": q[:, "xyzs".index(element)] for element in self.quaternion}


def attitude_of(history: History) -> Array:
    """Return the attitudes of a history as quaternions of length 1: x, y, z, s, body to reference, without jumps."""
    return quaternions.from_matrices(history.matrices())


def roll_pitch_heading(q: Array) -> Array:
    """Return roll, pitch and heading in rad, (N, 3); roll is 0 where pitch is vertical to the last digit."""
    from strapgen.run.backends import evaluator

    return np.asarray(evaluator("euler-angles-from-dcm")(quaternions.matrices(q), np.zeros((len(q), 3))))


def tum(history: History) -> str:
    """Return the attitude as a trajectory of the TUM RGB-D benchmark: time, position 0 0 0, quaternion x y z s."""
    rows = zip(history.time.tolist(), attitude_of(history).tolist(), strict=True)
    return "".join(f"{time!r} 0 0 0 {' '.join(map(repr, q))}\n" for time, q in rows)


def kitti(history: History) -> str:
    """Return the attitude as poses of the KITTI benchmark: the rows of [C | 0], body to reference, without times."""
    C = history.matrices()
    rows = np.concatenate([C, np.zeros((len(C), 3, 1))], axis=2).reshape(-1, 12).tolist()
    return "".join(f"{' '.join(map(repr, row))}\n" for row in rows)


def parquet(columns: dict[str, Array]) -> bytes:
    """Return columns as a Parquet file."""
    try:
        pyarrow, files = (importlib.import_module(name) for name in ("pyarrow", "pyarrow.parquet"))
    except ImportError:
        raise MissingExtraError("Parquet needs pyarrow: pip install 'strapgen[logs]'") from None
    content = io.BytesIO()
    files.write_table(pyarrow.table(columns), content)
    return content.getvalue()


def frame(columns: dict[str, Array]) -> Any:
    """Return columns as a data frame of the first library that is installed: pandas, polars or pyarrow."""
    for library, make in (("pandas", "DataFrame"), ("polars", "DataFrame"), ("pyarrow", "table")):
        try:
            module = importlib.import_module(library)
        except ImportError:
            continue
        return getattr(module, make)(columns)
    raise MissingExtraError("data frames need pandas, polars or pyarrow: pip install 'strapgen[notebook]'")
