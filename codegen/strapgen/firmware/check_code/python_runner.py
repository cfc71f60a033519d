"""Calls a user's function in Python, in a process of its own that may crash.

Run as ``python -P python_runner.py FOLDER CALLS``, as `strapgen.firmware.check_code.foreign.run_calls` does, or without
CALLS to write to ``described`` what it takes, and which variables there are. The folder has a ``plan`` of the call in
JSON.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import inspect
import json
import os
import sys
import textwrap
import traceback
from contextlib import suppress
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from strapgen.ir.checks import did_you_mean


class _RefusedError(Exception):
    """The function cannot be called as it is said."""


def main(folder_name: str, calls: str = "") -> None:
    """Call the function and write its results."""
    folder = Path(folder_name)
    plan = json.loads((folder / "plan").read_text(encoding="utf-8"))
    try:
        os.chdir(plan["folder"])
        module = _module(plan)
        owner, function = _found(module, plan)
        if calls:
            _call(folder, plan, module, owner, function, int(calls))
        else:
            _write(folder / "described", json.dumps(_described(plan, module, owner, function)))
    except _RefusedError as refused:
        _write(folder / "refused", str(refused))


def _write(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8", newline="\n")


def _module(plan: dict[str, Any]) -> Any:
    """Import the module of the function."""
    sys.path.insert(0, plan["folder"])
    name, file = plan["module"], plan["file"]
    try:
        if not file:
            return importlib.import_module(name)
        spec = importlib.util.spec_from_file_location(name, file)
        assert spec is not None and spec.loader is not None, "it is a file of Python"
        module = sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
    except ModuleNotFoundError as error:
        if error.name and (name == error.name or name.startswith(f"{error.name}.")):
            raise _RefusedError(
                f"there is no module {name} in {plan['folder']} or among those installed"
            ) from error
        raise _RefusedError(f"{name} imports {error.name}, which is not installed") from error
    except BaseException as error:
        raise _RefusedError(f"the import of {file or name} raises {_said(error)}") from error


def _found(module: Any, plan: dict[str, Any]) -> tuple[Any, Any]:
    """Return the class that a function is a method of, or None, and the function."""
    owner, holder = None, module
    for name in plan["function"].split("."):
        if not hasattr(holder, name):
            names = [
                one for one in vars(holder) if callable(getattr(holder, one)) and not one.startswith("_")
            ]
            guess, where = did_you_mean("function", name, names), plan["file"] or plan["module"]
            raise _RefusedError(f"{where} has no {name}{guess}; it has {', '.join(names) or 'no function'}")
        owner, holder = holder, getattr(holder, name)
    if inspect.isclass(holder) or not callable(holder):
        raise _RefusedError(f"{plan['function']} is no function; a method of a class is named Class.method")
    return (owner if inspect.isclass(owner) else None), holder


def _described(plan: dict[str, Any], module: Any, owner: Any, function: Any) -> dict[str, Any]:
    """Return the parameters of a function, whether it returns anything, and the variables of its object and module."""
    try:
        parameters = [*inspect.signature(function).parameters.values()]
    except (TypeError, ValueError):  # built in
        return {"parameters": None, "owner": owner is not None}
    if owner is not None and not isinstance(
        inspect.getattr_static(owner, function.__name__), staticmethod | classmethod
    ):
        parameters = parameters[1:]
    optional = [
        each.name
        for each in parameters
        if each.default is not each.empty or each.kind in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
    ]
    fields: dict[str, int] = {}
    try:
        fields = {} if owner is None else _sizes(_begin(plan, module, owner, np.empty(0))[1])
    except _RefusedError:
        raise
    except Exception:  # a call will say it
        fields = {}
    return {
        "parameters": [f"{each.name}{'=' * (each.name in optional)}" for each in parameters],
        "returns": _returns(function),
        "owner": owner is not None,
        "fields": fields,
        "variables": _sizes(module, levels=1),
    }


def _returns(function: Any) -> bool:
    """Return whether a function has a statement that returns a value."""
    try:
        text = textwrap.dedent(inspect.getsource(function))
        return any(
            isinstance(each, ast.Return) and each.value is not None for each in ast.walk(ast.parse(text))
        )
    except (OSError, TypeError, SyntaxError):
        return True


def _sizes(holder: Any, levels: int = 2) -> dict[str, int]:
    """Return how many numbers the variables of an object or a module have, those of inner objects included."""
    sizes = {}
    for name in dict.fromkeys([*getattr(holder, "__dict__", ()), *dir(holder)]):
        value = None
        with suppress(Exception):  # of a property
            value = None if name.startswith("__") else getattr(holder, name)
        if value is None or callable(value) or inspect.ismodule(value):
            continue
        value = value.as_quat() if hasattr(value, "as_quat") else value
        if isinstance(value, int | float | list | tuple) or hasattr(value, "__array__"):
            with suppress(TypeError, ValueError):  # of words
                sizes[name] = np.asarray(value, np.float64).size
        elif levels > 1 and hasattr(value, "__dict__"):
            sizes |= {f"{name}.{each}": size for each, size in _sizes(value, levels - 1).items()}
    return sizes


def _said(error: BaseException) -> str:
    """Return an exception in words, with the line of the user's file that raised it."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename != __file__]
    frames = [frame for frame in frames if "site-packages" not in frame.filename] or frames
    where = f" in line {frames[-1].lineno} of {Path(frames[-1].filename).name}" if frames else ""
    return f"{type(error).__name__}{f': {error}' if str(error) else ''}{where}"


def _call(folder: Path, plan: dict[str, Any], module: Any, owner: Any, function: Any, calls: int) -> None:
    """Call the function once for each row."""
    kind = np.float32 if plan["type"] == "float" else np.float64
    identity = np.fromfile(folder / "identity").astype(kind)
    rows = np.fromfile(folder / "input").reshape(calls, -1)
    outputs = np.empty((calls, identity.size))
    ends = np.cumsum([3, *(size for _, size in plan["fed"])])
    places = {name: slice(*ends[n : n + 2]) for n, (name, _) in enumerate(plan["fed"])}
    ends = np.cumsum([0, *(size for _, size, _, _ in plan["results"])])
    as_rotation, changed, target = _takes_rotation(function, plan), False, module
    by_keyword: set[str] = set()
    state = identity
    for number, row in enumerate(rows):
        try:
            if row[0]:
                state, target = _begin(plan, module, owner, identity)
            known = {name: row[place] for name, place in places.items()}
            known |= {
                held: state[slice(*ends[n : n + 2])] for n, (_, _, held, _) in enumerate(plan["results"])
            }
            known |= {"dt": row[1], "dt_ms": 1e3 * row[1], "dt_us": 1e6 * row[1], "step": row[2]}
            known |= plan["constants"] | {"zeros": np.zeros(9)}
            given: list[Any] = [
                _given(known[name], shape, element, kind) for name, shape, element in plan["parameters"]
            ]
            before = [each.copy() if isinstance(each, np.ndarray) else each for each in given]
            by_name = {name: each for (name, *_), each in zip(plan["parameters"], given, strict=True)}
            if as_rotation:
                given[[*by_name].index("state")] = as_rotation(known["state"])
            bound = getattr(target, plan["function"].rpartition(".")[2]) if owner is not None else function
            if not number:
                by_keyword = _by_keyword(bound)
            named = [*zip(plan["names"], given, strict=True)]
            returned = bound(
                *(each for name, each in named if name not in by_keyword),
                **{name: each for name, each in named if name in by_keyword},
            )
        except _RefusedError:
            raise
        except BaseException as error:
            _write(folder / "stopped", f"it raises {_said(error)}")
            return
        outputs[number] = np.concatenate(_results(plan, module, target, returned, by_name))
        state = outputs[number].astype(kind)
        in_place = [held for name, _, held, _ in plan["results"] if name == held and returned is None]
        changed |= any(
            isinstance(after, np.ndarray) and name not in in_place and after.tobytes() != kept.tobytes()
            for (name, *_), after, kept in zip(plan["parameters"], given, before, strict=True)
        )
    outputs.tofile(folder / "output")
    _write(folder / "flags", str(2 * changed))


def _given(numbers: Any, shape: list[int], element: int, kind: Any) -> Any:
    """Return an argument: an array, one element of it, or a number."""
    if element >= 0:
        return float(numbers[element])
    if shape:
        return np.array(numbers[: np.prod(shape)], kind).reshape(shape)
    return numbers if isinstance(numbers, bool) else float(numbers)


def _results(
    plan: dict[str, Any], module: Any, target: Any, returned: Any, given: dict[str, Any]
) -> list[Any]:
    """Return the numbers of all results: returned, several as a tuple, or changed in place, or read afterwards."""
    returns = [name for name, _, _, places in plan["results"] if not places]
    if len(returns) > 1 and returned is not None:
        if not isinstance(returned, tuple | list) or len(returned) != len(returns):
            raise _RefusedError(f"{plan['function']} is to return a tuple of {', '.join(returns)}")
        several = dict(zip(returns, returned, strict=True))
    else:
        several = dict.fromkeys(returns, returned)
    numbers = []
    for name, size, held, places in plan["results"]:
        if places:
            several_read = [
                _attribute(target if place.startswith("self.") else module, place.removeprefix("self."))
                for place in places
            ]
            read = several_read if len(places) > 1 else several_read[0]
        else:
            read = given[name] if returned is None and name == held else several[name]
        numbers.append(_numbers(plan, read, size))
    return numbers


def _by_keyword(function: Any) -> set[str]:
    """Return the names of those parameters that a call has to name."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # built in
        return set()
    return {each.name for each in parameters if each.kind is each.KEYWORD_ONLY}


def _takes_rotation(function: Any, plan: dict[str, Any]) -> Any:
    """Return what makes a Rotation of SciPy of a state, if the state of a function is annotated as one."""
    by_meaning = {
        meaning: name for (meaning, *_), name in zip(plan["parameters"], plan["names"], strict=True)
    }
    annotation = getattr(function, "__annotations__", {}).get(by_meaning.get("state"))
    if "Rotation" not in str(annotation):
        return None
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat


def _begin(plan: dict[str, Any], module: Any, owner: Any, identity: Any) -> tuple[Any, Any]:
    """Begin a run: return the state, and the object whose method is called."""
    if not plan["init"]:
        return identity, (module if owner is None else _made(owner))
    init, arguments = _stated(plan["init"])
    if hasattr(module, init):
        made = getattr(module, init)(*arguments)
        if owner is not None:
            return identity, (_made(owner) if made is None else made)
        return (
            identity if made is None else _numbers(plan, made, identity.size).astype(identity.dtype)
        ), module
    target = _made(owner) if owner is not None else None
    if target is None or not hasattr(target, init):
        raise _RefusedError(f"--init {init}: {plan['module']} has no function {init}")
    getattr(target, init)(*arguments)
    return identity, target


def _stated(init: str) -> tuple[str, tuple[Any, ...]]:
    """Return the name and the arguments of a call, or of a name alone.

    >>> _stated("Filter(0.01, 'fast')"), _stated("reset")
    (('Filter', (0.01, 'fast')), ('reset', ()))
    """
    name, _, rest = init.partition("(")
    try:
        return name, ast.literal_eval(f"({rest[:-1]},)") if rest[:-1].strip() else ()
    except (SyntaxError, ValueError):
        raise _RefusedError(
            f"--init {init}: the arguments of a call are numbers or texts, as in Filter(0.01)"
        ) from None


def _made(owner: Any) -> Any:
    """Return a new object of a class."""
    try:
        return owner()
    except TypeError as error:
        name = owner.__name__
        raise _RefusedError(
            f"{name}() raises {_said(error)}; --init states its arguments, as in {name}(0.01), or a function of the "
            "module that makes the object"
        ) from error


def _attribute(holder: Any, path: str) -> Any:
    """Return an attribute by its path, as "attitude.q"."""
    try:
        return reduce(getattr, path.split("."), holder)
    except AttributeError as error:
        raise _RefusedError(f"--arguments: {error}; the attitude is read from {path}") from error


def _numbers(plan: dict[str, Any], read: Any, size: int) -> Any:
    """Return the attitude as numbers, also of a Rotation of SciPy."""
    if hasattr(read, "as_quat"):
        read = read.as_quat() if size == 4 else read.as_matrix() if size == 9 else read.as_rotvec()
    function = plan["function"]
    if read is None:
        raise _RefusedError(
            f"{function} returns None; where it leaves the attitude stands behind the arrow of --arguments, as "
            '"rates[3], dt -> self.q[4]"'
        )
    try:
        numbers = np.asarray(read, np.float64)
    except (TypeError, ValueError) as error:
        raise _RefusedError(f"{function} gives a {type(read).__name__}; {size} numbers are needed") from error
    if numbers.size != size:
        raise _RefusedError(
            f"{function} gives an array of the shape {list(numbers.shape)}; {size} numbers are needed"
        )
    return numbers.ravel()


if __name__ == "__main__":
    main(*sys.argv[1:])
