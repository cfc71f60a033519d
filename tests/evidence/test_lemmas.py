"""The lemmas of the functions that shift and take roots: proved as they are printed, and refused with a fault."""

import pytest

pytest.importorskip("z3")
pytest.importorskip("pycparser")

from strapgen.catalogue import Choice
from strapgen.evidence.overflow.bit_vectors import shifts_down
from strapgen.evidence.overflow.c_types import MODELS
from strapgen.evidence.overflow.parsed import ParsedSource
from strapgen.evidence.overflow.square_root import is_root
from strapgen.evidence.subjects import Subject
from strapgen.ir.fixed_settings import Settings

PLACES = [0, 1, 31, 32, 33, 60]


def function(part, fault=("", ""), defined=(), settings=None):
    """Return one of the functions of a kernel that has them all, with a fault in its text."""
    subject = Subject(Choice("euler-normalize"), settings)
    files = subject.sources.step_files
    right, wrong = fault
    source = files[f"{subject.name}.c"]
    assert right in source
    files = {**files, f"{subject.name}.c": source.replace(right, wrong) if right else source}
    return ParsedSource(files, f"{subject.name}.c", defined).functions[f"{subject.name}_{part}"]


@pytest.mark.long
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("defined", [(), ("__FRAMAC__",)], ids=["shipped", "as Eva reads it"])
def test_shifts(model, defined):
    """Both forms of a shift round down, for every number that fits."""
    assert shifts_down(function("fit", defined=defined), model, PLACES)
    assert shifts_down(function("shr"), model, PLACES)


@pytest.mark.long
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(("? ~(~high >> beyond)", "? (high >> beyond)"), id="shift of a negative number"),
        pytest.param(("n - first", "n"), id="places"),
        pytest.param(("(bits <= (UINT32_MAX >> 1))", "(bits <= (UINT32_MAX >> 2))"), id="half of the words"),
        pytest.param(("(-1 - (int32_t)", "(-(int32_t)"), id="sign"),
        pytest.param(("(n > 32) ? 32 : n", "n"), id="bits beyond a word"),
    ],
)
def test_shifts_with_a_fault(fault):
    """The proof does not go through where the function is wrong or leaves something to the compiler."""
    if fault[0].startswith(
        "(bits <="
    ):  # the largest word itself takes the way of negative numbers, out of range
        fault = (fault[0], "(bits <= (UINT32_MAX >> 2))")
    assert not shifts_down(function("fit", fault), MODELS["64-bit processor"], PLACES)


@pytest.mark.parametrize("rounding", ["nearest", pytest.param("truncation", marks=pytest.mark.long)])
def test_root(rounding):
    """The root is the integer next to it, or below it."""
    found = function("rt", settings=Settings(rounding=rounding))
    assert is_root(found, MODELS["16-bit int"], rounding == "nearest")
    assert not is_root(found, MODELS["16-bit int"], rounding != "nearest")


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(("rest >= tried", "rest > tried"), id="perfect square"),
        pytest.param(("rest -= tried", "rest -= bit"), id="rest"),
        pytest.param(("1 << 62", "1 << 60"), id="first bit"),
        pytest.param(("rest > root", "rest >= root"), id="rounding"),
        pytest.param(("root >>= 1", "root >>= 2"), id="root"),
    ],
)
def test_root_with_a_fault(fault):
    """Every statement of the loop matters to the proof."""
    assert not is_root(function("rt", fault), MODELS["64-bit processor"], True)
