"""Algorithms that users bring: a Python file, or an entry point of an installed package.

Both give a function called ``algorithm`` that returns the `Kernel` of an attitude step. Its parameters, if it has any,
are chosen by name from `OPTIONS`.
"""

from __future__ import annotations

import importlib.util
import inspect
import shlex
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen import checks
from strapgen.exceptions import InputError, StrapgenError

if TYPE_CHECKING:
    from strapgen.kernel import Kernel

#: Entry points of installed packages.
GROUP = "strapgen.algorithms"
#: Name of the function in a file.
FUNCTION = "algorithm"
#: What the function may take: a `Tableau`, and how many increments.
OPTIONS = ("method", "increments", "previous")

#: Kernels that were loaded in this process, by name.
KERNELS: dict[str, Kernel] = {}


def installed() -> dict[str, EntryPoint]:
    """Return the entry points of installed packages by name."""
    return {point.name: point for point in entry_points(group=GROUP)}


def load(name: str, catalogue: frozenset[str], **options: Any) -> Kernel:
    """Load an algorithm, check its kernel and remember it with the kernels of its own.

    Parameters
    ----------
    name : str
        A Python file, or the name of an entry point.
    catalogue : frozenset of str
        Kernels that there are already.
    **options
        Of `OPTIONS`, those that the user chose.

    Returns
    -------
    Kernel

    Raises
    ------
    InputError
        If there is no such algorithm, its code fails, or what it returns is no attitude step.
    """
    function = _from_file(Path(name)) if name.endswith(".py") else _guarded(name, installed()[name].load)
    if not callable(function):
        raise InputError(f"{name}: {FUNCTION} is no function; one that returns a Kernel is needed")
    parameters = _guarded(name, lambda: inspect.signature(function).parameters)
    takes = [option for option in OPTIONS if option in parameters]
    for option in options:
        if option not in takes:
            raise InputError(
                f"{name}: its {FUNCTION}({', '.join(takes)}) takes no {option}; {_allowed(takes)}"
            )
    kernel = _guarded(name, lambda: function(**options))
    _check(name, kernel, catalogue)
    kernel = replace(kernel, arguments=_arguments(name, options))
    for made in (kernel, *kernel.own):
        KERNELS[made.name] = made
    return kernel  # type: ignore[no-any-return]


def _arguments(name: str, options: dict[str, Any]) -> str:
    """Return what makes a kernel again on the command line: file or entry point as they were given, and the options."""
    words = [shlex.quote(checks.text("the name of the file", name))]
    for option, value in options.items():
        if option == "method":
            words.append(value.option)
        else:
            words += [f"--{option}", str(value)]
    return " ".join(words)


def _allowed(takes: list[str]) -> str:
    return f"it takes {', '.join(takes)}" if takes else "it takes no options"


def _from_file(path: Path) -> Callable[..., Any]:
    if not path.is_file():
        raise InputError(f"algorithm {path} is no file; a Python file with a function {FUNCTION} is needed")
    spec = importlib.util.spec_from_file_location(f"strapgen_user_{path.stem}", path)
    assert spec is not None and spec.loader is not None, "a .py file has a loader"
    module = importlib.util.module_from_spec(spec)
    _guarded(str(path), partial(spec.loader.exec_module, module))
    if not hasattr(module, FUNCTION):
        raise InputError(f"{path} defines no function {FUNCTION}; one that returns a Kernel is needed")
    function: Callable[..., Any] = getattr(module, FUNCTION)
    return function


def _guarded(name: str, run: Callable[[], Any]) -> Any:
    """Run a user's code; where it fails, say where and why in one line."""
    try:
        return run()
    except StrapgenError:
        raise
    except Exception as error:
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename != __file__]
        own = [frame for frame in frames if Path(frame.filename).name == Path(name).name] or frames
        line = error.lineno if isinstance(error, SyntaxError) else own[-1].lineno if own else None
        where = "" if line is None else f", line {line}"
        said = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
        raise InputError(f"{name}{where}: {type(error).__name__}: {said}") from error


def _check(name: str, kernel: Any, catalogue: frozenset[str]) -> None:
    """Check that what a user's function returned is the kernel of an attitude step."""
    from strapgen.kernel import Kernel

    def refuse(reason: str) -> None:
        raise InputError(f"{name}: {reason}")

    if not isinstance(kernel, Kernel):
        refuse(f"{FUNCTION}() returned {type(kernel).__name__}; a Kernel is needed")
    if kernel.companions is None:
        refuse(f"kernel {kernel.name} has no companions; an attitude step needs them")
    for made in (kernel, *kernel.own):
        if not made.name.replace("-", "_").isidentifier() or made.name != made.name.lower():
            refuse(f"kernel {made.name!r} has no name for generated code; a-z, 0-9 and hyphens are allowed")
        if made.name in catalogue:
            refuse(f"kernel {made.name} is in the catalogue; another name is needed")
        signals = [*made.inputs, *(stage.signal for stage in (*made.stages, *made.outputs))]
        for signal in signals:
            for part in (signal.name, *signal.elements):
                if not (part.isascii() and part.isidentifier()):
                    refuse(f"kernel {made.name}: {part!r} is no name for generated code")
        texts = {"title": made.title, "source": made.source}
        texts |= {f"note {number}": note for number, note in enumerate(made.notes, 1)}
        texts |= {f"meaning of {signal.name}": signal.meaning for signal in signals}
        texts |= {f"unit of {signal.name}": signal.unit for signal in signals}
        for what, text in texts.items():
            checks.text(f"{name}: kernel {made.name}: its {what}", text)
        known = {element for signal in made.inputs for element in signal.elements}
        for stage in (*made.stages, *made.outputs):
            if len(stage.expressions) != stage.signal.size:
                refuse(
                    f"kernel {made.name}: {stage.signal.name} has {len(stage.expressions)} expressions for "
                    f"{stage.signal.size} elements"
                )
            free = {symbol.name for e in stage.expressions for symbol in e.free_symbols}
            if unknown := sorted(free - known):
                refuse(
                    f"kernel {made.name}: {stage.signal.name} uses {', '.join(unknown)}, not defined before it"
                )
            known.update(stage.signal.elements)
    companions = kernel.companions
    names = [signal.name for signal in kernel.inputs]
    samples: tuple[int, ...] = kernel.inputs[1].shape if len(kernel.inputs) == 2 else ()
    if names != ["state", "increments"] or len(samples) != 2 or samples[1] != 3:
        refuse(f"kernel {kernel.name} takes {', '.join(names)}; state and increments (K, 3) are needed")
    state = kernel.inputs[0]
    if len(kernel.outputs) != 1 or kernel.outputs[0].signal.shape != state.shape:
        refuse(f"kernel {kernel.name}: one output of the shape of the state, {state.shape}, is needed")
    if len(companions.identity) != state.size:
        refuse(
            f"kernel {kernel.name}: identity has {len(companions.identity)} elements, the state {state.size}"
        )
    if not 0 <= companions.previous < samples[0]:
        refuse(
            f"kernel {kernel.name}: {companions.previous} of its {samples[0]} increments are previous ones"
        )
    if (companions.product is None) != (kernel.transition is None):
        refuse(f"kernel {kernel.name}: a product and a transition go together")
    own = {made.name: made for made in kernel.own}
    for role in ("product", "orthonormalize", "attitude"):
        companion = getattr(companions, role)
        if companion is not None and companion not in catalogue and companion not in own:
            refuse(f"kernel {kernel.name}: its {role} {companion!r} is neither in the catalogue nor its own")
    attitude = own.get(companions.attitude or "")
    if attitude and (
        [signal.shape for signal in attitude.inputs] != [state.shape]
        or [stage.signal.shape for stage in attitude.outputs] != [(3, 3)]
    ):
        refuse(f"kernel {attitude.name}: it must turn a state {state.shape} into a matrix (3, 3)")
    if attitude is None and companions.attitude is None and state.shape != (3, 3):
        refuse(f"kernel {kernel.name}: attitude is None, but the state is no matrix (3, 3)")
