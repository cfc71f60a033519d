"""A program is straight-line code on scalars, the form between symbolic kernels and printed sources.

It is a list of single static assignments. The right side of each is a small tree of operations over constants
(exact rationals), inputs and names assigned before it. This module depends neither on SymPy nor on a target.
"""

from __future__ import annotations

import importlib
import itertools
import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Any, Generic, NamedTuple, TypeVar, overload

from strapgen.ir.kernel_info import AttitudeStep, KernelInfo, Recursion
from strapgen.ir.notebook_display import notebook_html, short_repr
from strapgen.ir.read_only import ReadOnlyDict
from strapgen.ir.renamed import renamed
from strapgen.ir.signals import Signal

T = TypeVar("T")


class once(Generic[T]):  # noqa: N801 - a decorator
    """A property that is worked out when it is first read, for objects of which there are hundreds of thousands.

    It is `functools.cached_property` without the lock that Python 3.11 takes for every value; where threads read one
    at once, each may work it out.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self._function, self._name = function, function.__name__
        self.__doc__ = function.__doc__

    @overload
    def __get__(self, instance: None, owner: type) -> once[T]: ...

    @overload
    def __get__(self, instance: object, owner: type) -> T: ...

    def __get__(self, instance: object | None, owner: type) -> once[T] | T:
        if instance is None:
            return self
        value = instance.__dict__[self._name] = self._function(instance)
        return value


@dataclass(frozen=True)
class Constant:
    """An exact rational number."""

    value: Fraction


@dataclass(frozen=True)
class Reference:
    """An input element or a name assigned earlier."""

    name: str


@dataclass(frozen=True)
class Operation:
    """An operation of `OPERATIONS` on its arguments."""

    kind: str
    arguments: tuple[Node, ...]

    # Trees are deep, share their branches and are looked up often: hash, size, names and text are worked out once.
    def __hash__(self) -> int:
        return self._hash

    @once
    def _hash(self) -> int:
        return hash((self.kind, self.arguments))

    @once
    def size(self) -> int:
        """Number of operations in the tree."""
        return 1 + sum(node.size for node in self.arguments if isinstance(node, Operation))

    @once
    def names(self) -> frozenset[str]:
        """The names that the tree uses."""
        return frozenset().union(*map(names_in, self.arguments))

    def __repr__(self) -> str:
        return self._text

    @once
    def _text(self) -> str:
        return f"Operation(kind={self.kind!r}, arguments={self.arguments!r})"

    def __reduce__(self) -> tuple[type[Operation], tuple[str, tuple[Node, ...]]]:
        return Operation, (self.kind, self.arguments)  # the hash is that of one process


Node = Constant | Reference | Operation


def _wrap(x: Any) -> Any:
    return x - math.tau if x > math.pi else x + math.tau if x < -math.pi else x


#: The name that stands in programs for the distance from 1 to the next number of the target.
RESOLUTION = "resolution"
#: The resolution of a double.
DOUBLE_RESOLUTION = Fraction(1, 1 << 52)
#: The function of each operation, on any ordered numbers; the integer, exact and float interpreters share it.
OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "negate": operator.neg,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "sinc": lambda x: math.sin(x) / x if x else 1,
    "atan2": math.atan2,
    "direction": math.atan2,  # atan2 up to whole turns
    "wrap": _wrap,  # an angle of at most one and a half turns, reduced to -pi to pi
    "maximum": max,
    "at_least": operator.ge,  # a condition: first >= second
    "select": lambda condition, yes, no: yes if condition else no,
}

#: The key of `Program.operations` under which an operation is counted.
COUNTED_AS: Mapping[str, str | None] = {
    **{kind: kind for kind in ("add", "multiply", "divide", "sqrt", "negate", "select")},
    **{"subtract": "add", "maximum": "select"},
    "at_least": None,  # counted with its select
    **dict.fromkeys(("sin", "cos", "sinc", "atan2", "direction", "wrap"), "function"),
}


@dataclass(frozen=True)
class Assignment:
    """``name = value``; the first assignment of a named stage of the algorithm has its `meaning`."""

    name: str
    value: Node
    meaning: str = ""
    #: Bound of the distance of the value from the function whose series it is.
    remainder: Fraction = Fraction(0)


@dataclass(frozen=True)
class Result:
    """An output signal and, for each element, the reference or constant that holds it."""

    signal: Signal
    nodes: tuple[Node, ...]


class _Instructions(NamedTuple):
    """A program in single operations, each of which puts its value into a slot."""

    size: int
    names: list[tuple[int, str]]
    constants: list[tuple[int, Fraction]]
    operations: list[tuple[int, str, tuple[int, ...]]]
    results: list[tuple[str, list[int]]]


@renamed(companions="attitude_step", own="bundled_programs", function="chosen_name")
@dataclass(frozen=True)
class Program:
    """Straight-line code for one kernel.

    Parameters
    ----------
    info : KernelInfo
        What is said of the kernel that it was lowered from.
    inputs : tuple of Signal
        Inputs; their elements are known from the start.
    body : tuple of Assignment
        The code.
    outputs : tuple of Result
        Outputs, with the node that holds each element.
    transition : Result or None
        For a step that is linear in the state, the part that depends on the increments alone.
    bundled_programs : tuple of Program
        Kernels that a user's step brings.
    name : str
        Name in generated code; by default the identifier of the kernel.
    chosen_name : str
        Name of the function in C if the user chooses it, with {} for the name that the target gives; "" for that name.

    Raises
    ------
    ValueError
        If a name is used before it is assigned, or assigned twice.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> program = algorithm("euler", "rk4", 2).program()
    >>> program.operations["multiply"], program.temporaries
    (37, 15)
    """

    info: KernelInfo
    inputs: tuple[Signal, ...]
    body: tuple[Assignment, ...]
    outputs: tuple[Result, ...]
    transition: Result | None = None
    bundled_programs: tuple[Program, ...] = ()
    name: str = ""
    chosen_name: str = ""

    __repr__ = short_repr
    _repr_html_ = notebook_html

    def _in_words(self) -> str:
        counts = ", ".join(f"{number} {kind}" for kind, number in self.operations.items() if number)
        return f"{self.name}: {self.title}\n{counts or 'no operations'}; {self.temporaries} temporaries"

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.info.identifier)
        known = {element for signal in self.inputs for element in signal.elements} | {RESOLUTION}
        for assignment in self.body:
            if assignment.name in known:
                raise ValueError(f"{self.name}: {assignment.name!r} is assigned twice")
            if not names_in(assignment.value) <= known:
                unknown = sorted(names_in(assignment.value) - known)
                raise ValueError(f"{self.name}: {assignment.name!r} uses {unknown} before assignment")
            known.add(assignment.name)
        for result in self.results:
            missing = set().union(*map(names_in, result.nodes)) - known
            if len(result.nodes) != result.signal.size or missing:
                raise ValueError(f"{self.name}: {result.signal.name!r} is not computed: {sorted(missing)}")

    @property
    def kernel(self) -> str:
        """Name of the kernel."""
        return self.info.name

    @property
    def title(self) -> str:
        """One line that says what it computes."""
        return self.info.title

    @property
    def source(self) -> str:
        """Where the algorithm comes from."""
        return self.info.source

    @property
    def arguments(self) -> str:
        """Name and options that choose the kernel on the command line."""
        return self.info.arguments

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks for the reader of generated code."""
        return self.info.notes

    @property
    def attitude_step(self) -> AttitudeStep | None:
        """The kernels of an attitude step; None for every other program."""
        return self.info.attitude_step

    @property
    def recursion(self) -> Recursion | None:
        """The pairs of an output and the input that it becomes in the next call."""
        return self.info.recursion

    @property
    def increments_per_step(self) -> int | None:
        """Number of angle increments of a step, without those from beside it; None if it takes none."""
        for signal in self.inputs:
            if signal.name == "increments":
                beside = [name for name in signal.elements if name.startswith(("past", "ahead"))]
                return max(1, (signal.size - len(beside)) // 3)
        return None

    @property
    def results(self) -> tuple[Result, ...]:
        """The outputs, and the transition where there is one."""
        return self.outputs if self.transition is None else (*self.outputs, self.transition)

    @once
    def operations(self) -> Mapping[str, int]:
        """Count of operations by kind; subtractions count as additions.

        "select" counts choices between two values, "function" counts sin, cos, sin(x)/x, atan2 and "wrap".
        """
        counts = dict.fromkeys(("add", "multiply", "divide", "sqrt", "negate", "select", "function"), 0)
        for assignment in self.body:
            for node in walk(assignment.value):
                key = COUNTED_AS[node.kind] if isinstance(node, Operation) else None
                if key:
                    counts[key] += 1
        return ReadOnlyDict(counts)

    @once
    def temporaries(self) -> int:
        """Number of assigned names that are not elements of an output."""
        held = {node.name for result in self.outputs for node in result.nodes if isinstance(node, Reference)}
        return sum(assignment.name not in held for assignment in self.body)

    def run(
        self,
        values: Mapping[str, Any],
        number: Callable[[Fraction], Any] | None = None,
        operations: Mapping[str, Callable[..., Any]] = OPERATIONS,
    ) -> dict[str, list[Any]]:
        """Execute the program on numbers of any kind.

        Sums, products and quotients use the operators of the numbers, so they are exact for `Fraction`. Roots and
        functions are computed in double unless `operations` replaces them.

        Parameters
        ----------
        values : mapping of str to number
            A value for every input element; `RESOLUTION` may be among them, otherwise it is that of a double.
        number : callable, optional
            Converts a constant; by default it stays an exact `Fraction`.
        operations : mapping of str to callable, optional
            The function of each operation.

        Returns
        -------
        dict of str to list
            For each output its elements, row-major.
        """
        constant = number or (lambda exact: exact)
        known = {RESOLUTION: constant(DOUBLE_RESOLUTION), **values}
        code = self._instructions
        slots: list[Any] = [None] * code.size
        for slot, name in code.names:
            slots[slot] = known[name]
        for slot, value in code.constants:
            slots[slot] = constant(value)
        for slot, kind, arguments in code.operations:
            slots[slot] = operations[kind](*[slots[k] for k in arguments])
        return {name: [slots[k] for k in elements] for name, elements in code.results}

    def function(self, framework: str) -> Any:
        """Return the program as a function of another framework, in double precision.

        Arguments and results are those of the generated C, in the same order. The operations are too, so that values
        differ from it by rounding alone: where a framework fuses a product and a sum, and in sines and cosines.

        Parameters
        ----------
        framework : str
            "jax" and "torch" take and return arrays (..., shape), whose leading dimensions are broadcast; the function
            can be differentiated and mapped, and compiled by ``jax.jit``. "casadi" returns a ``casadi.Function`` of SX,
            with vectors as columns. "numba" returns one that ``numba.njit`` compiles, of one sample as arrays
            (shape), float64. "sympy" returns one of matrices of exact expressions.

        Returns
        -------
        callable
            With a result, or a tuple of several. Derivatives by JAX, PyTorch and CasADi are finite at zero rotation.

        Raises
        ------
        MissingExtraError
            If the framework is not installed.
        InputError
            If it is not known, or JAX is set to 32 bits.

        Examples
        --------
        >>> from strapgen import algorithm
        >>> step = algorithm("euler", "rk1", increments=1).program().function("sympy")
        >>> step([0, 0, 0, 1], [["x", 0, 0]]).T
        Matrix([[x/2, 0, 0, 1]])
        """
        return importlib.import_module("strapgen.run.frameworks").function_of(self, framework)

    @once
    def _instructions(self) -> _Instructions:
        """The program as a list of single operations, which takes less time to run than its trees."""
        names: dict[str, int] = {}
        loaded: list[tuple[int, str]] = []
        constants: dict[Fraction, int] = {}
        operations: list[tuple[int, str, tuple[int, ...]]] = []
        slots = itertools.count()

        def slot_of(node: Node) -> int:
            if isinstance(node, Constant):
                if node.value not in constants:
                    constants[node.value] = next(slots)
                return constants[node.value]
            if isinstance(node, Reference):
                if node.name not in names:
                    names[node.name] = next(slots)
                    loaded.append((names[node.name], node.name))
                return names[node.name]
            arguments = tuple(map(slot_of, node.arguments))
            operations.append((next(slots), node.kind, arguments))
            return operations[-1][0]

        for assignment in self.body:
            names[assignment.name] = slot_of(assignment.value)
        results = [(result.signal.name, list(map(slot_of, result.nodes))) for result in self.outputs]
        pairs = [(slot, value) for value, slot in constants.items()]
        return _Instructions(next(slots), loaded, pairs, operations, results)

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def used(self, results: Iterable[Result] | None = None) -> set[str]:
        """Return the names that some results need, by default all results."""
        results = self.results if results is None else results
        needed = {name for result in results for node in result.nodes for name in names_in(node)}
        for assignment in reversed(self.body):
            if assignment.name in needed:
                needed |= names_in(assignment.value)
        return needed

    def transition_program(self) -> Program:
        """Return the part that computes the transition from the increments, as a separate program.

        Raises
        ------
        ValueError
            If the program has no transition.
        """
        if self.transition is None:
            raise ValueError(f"{self.name} has no transition")
        used = self.used([self.transition])
        return replace(
            self,
            info=replace(
                self.info, title=f"{self.title}: its transition", attitude_step=None, recursion=None
            ),
            inputs=tuple(s for s in self.inputs if used & set(s.elements)),
            body=tuple(a for a in self.body if a.name in used),
            outputs=(self.transition,),
            transition=None,
        )

    def split(self) -> tuple[Program, Program]:
        """Split the program into a part that does not depend on the first input, and the rest.

        In a run of many steps the first part can be computed for several steps at once; only the second part has to
        wait for the state of the previous step.

        Returns
        -------
        tuple of Program
            The first part, whose only output is ``prepared``, and the second part, which takes the first
            input and ``prepared``.
        """
        first = self.inputs[0]
        waiting = set(first.elements)
        ahead: list[Assignment] = []
        behind: list[Assignment] = []
        for assignment in self.body:
            if waiting.isdisjoint(names_in(assignment.value)):
                ahead.append(assignment)
            else:
                waiting.add(assignment.name)
                behind.append(assignment)
        results = {name for result in self.outputs for node in result.nodes for name in names_in(node)}
        needed = results.union(*(names_in(assignment.value) for assignment in behind)) - waiting
        order = [name for signal in self.inputs for name in signal.elements] + [a.name for a in ahead]
        names = tuple(name for name in order if name in needed)
        prepared = Signal("prepared", (len(names),), names, meaning="what depends on the other inputs alone")
        result = Result(prepared, tuple(map(Reference, names)))
        part = replace(self, info=replace(self.info, attitude_step=None), transition=None)
        return (
            replace(part, inputs=self.inputs[1:], body=tuple(ahead), outputs=(result,)),
            replace(part, inputs=(first, prepared), body=tuple(behind)),
        )


def walk(node: Node) -> Iterator[Node]:
    """Yield a node and all below it, each before its arguments."""
    pending = [node]
    while pending:
        node = pending.pop()
        yield node
        if isinstance(node, Operation):
            pending.extend(reversed(node.arguments))


def names_in(node: Node) -> frozenset[str]:
    """Return the names that a node uses."""
    if isinstance(node, Operation):
        return node.names
    return frozenset((node.name,) if isinstance(node, Reference) else ())


def references(node: Node) -> Iterator[str]:
    """Yield the names that a node uses, each as often as it occurs."""
    return (n.name for n in walk(node) if isinstance(n, Reference))
