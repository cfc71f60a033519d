"""Attitudes as SciPy's `Rotation`, and states of a back end from one; both turn body axes into reference axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError, MissingExtraError
from strapgen.lab.recordings.recording import History
from strapgen.lab.runs import Run, attitude, initial_state
from strapgen.run.backends import Backend


def to_rotation(attitudes: Run | History | Any, backend: Backend | None = None) -> Any:
    """Return attitudes as a `scipy.spatial.transform.Rotation`, which turns body axes into reference axes.

    Parameters
    ----------
    attitudes : Run, History or array_like
        A run, whose computed attitudes are taken; states of a back end, or of a history of one, (N, state shape); or
        direction cosine matrices (N, 3, 3), body to reference, without a back end. SciPy makes matrices orthogonal, and
        quaternions of length 1.
    backend : Backend, optional
        The back end that has these states; a history from `propagate` knows its own.

    Returns
    -------
    Rotation

    Raises
    ------
    MissingExtraError
        If SciPy is not installed.
    InputTypeError
        If the states of a history are not known as attitudes.
    InputError
        If the shape does not fit, or a number is not finite.

    Examples
    --------
    >>> from strapgen import backend, motion, simulate
    >>> euler = backend("euler")
    >>> run = simulate(euler, motion("constant", z_deg_s=90), "0.1", 1)
    >>> to_rotation(run)[-1].as_euler("xyz", degrees=True).round(3) + 0.0
    array([ 0.,  0., 90.])
    """
    rotation = _scipy()
    # SciPy 1.15 takes no array that is read-only, as those of results are.
    return rotation.from_matrix(_matrices(attitudes, backend).copy())


def _matrices(attitudes: Run | History | Any, backend: Backend | None) -> NDArray[np.float64]:
    """Return direction cosine matrices (N, 3, 3), body to reference."""
    if isinstance(attitudes, Run):
        return attitudes.computed
    if isinstance(attitudes, History):
        backend = backend or attitudes.backend
        if backend is None:
            raise InputTypeError("the states of this History are not known as attitudes of a back end")
        attitudes = attitudes.states
    if backend is None:
        return checks.real_array("attitudes", attitudes, (3, 3), np.dtype(np.float64))
    states = checks.real_array("states", attitudes, backend.state_shape, np.dtype(np.float64))
    return attitude(backend, states)


def from_rotation(rotation: Any, backend: Backend) -> NDArray[np.float64]:
    """Return the state of a back end that has an attitude, for `Backend.step` and `Backend.propagate`.

    Parameters
    ----------
    rotation : Rotation
        One of SciPy, which turns body axes into reference axes; `simulate` takes it as ``initial`` itself.
    backend : Backend

    Returns
    -------
    array, (state shape)

    Raises
    ------
    InputTypeError
        If it is no Rotation of SciPy.
    InputError
        If it holds several rotations, or no kernel converts a matrix to such a state.

    Examples
    --------
    >>> from scipy.spatial.transform import Rotation
    >>> from strapgen import backend
    >>> from_rotation(Rotation.from_euler("z", 90, degrees=True), backend("euler")).round(6)
    array([0.      , 0.      , 0.707107, 0.707107])
    """
    if not hasattr(rotation, "as_matrix"):
        raise InputTypeError(f"rotation is a {type(rotation).__name__}; a Rotation of SciPy is needed")
    matrix = np.asarray(rotation.as_matrix(), np.float64)
    if matrix.shape != (3, 3):
        raise InputError(f"rotation holds {len(matrix)} attitudes; a single one is needed")
    return initial_state(backend, matrix)


def _scipy() -> Any:
    """Return SciPy's class of rotations."""
    try:
        from scipy.spatial.transform import Rotation
    except ImportError:
        raise MissingExtraError("rotations need SciPy: pip install 'strapgen[notebook]'") from None
    return Rotation
