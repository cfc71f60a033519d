"""Kernels without overflow are proved so; a fault in their C makes each proof fail."""

import pytest

pytest.importorskip("z3")
pytest.importorskip("pycparser")

from strapgen.catalogue import Choice
from strapgen.evidence.collection import Subject
from strapgen.evidence.overflow import provers
from strapgen.evidence.overflow.c_types import MODELS
from strapgen.evidence.overflow.lemmas import ParsedSource, is_root, shifts_down
from strapgen.evidence.overflow.obligations import KernelStatements
from strapgen.ir.fixed_settings import CARRIES, Settings

MODEL = "16-bit int"
RK1 = Choice("euler", "rk1", 2)

NAME = "euler_rk1_2_w32"
needs_z3 = pytest.mark.skipif(not provers.Z3.installed(), reason=f"install {provers.Z3.package}")
needs_eva = pytest.mark.skipif(not provers.EVA.installed(), reason=f"install {provers.EVA.package}")

#: Texts of the C, with what a fault makes of them.
FAULTS = {
    "shift": ("+ 2, 2);", "+ 2, 1);"),
    "shift, though nothing overflows": (">> 32)", ">> 31)"),
    "widening": (f"{NAME}_mul(e_s, half_turn_0_x)", "(e_s * half_turn_0_x)"),
    "sign": ("3)\n        - (int64_t)d2_x", "3)\n        + (int64_t)d2_x * 2"),
    "factor": (f"{NAME}_mul(d1_x, 3)", f"{NAME}_mul(d1_x, 30)"),
    "removed check": (f"\n        || {NAME}_out(d2_z, (INT32_C(1) << 30))", ""),
    "weaker check": (f"{NAME}_out(e_s, INT32_C(1140850688))", f"{NAME}_out(e_s, INT32_C(2140850688))"),
}

#: One fault with the quick tests, all with the long ones.
each_fault = pytest.mark.parametrize(
    "fault",
    [
        pytest.param(fault, id=name, marks=() if name.startswith("removed") else pytest.mark.long)
        for name, fault in FAULTS.items()
    ],
)


def faulty(subject, fault):
    """Return the files of a kernel with a fault in its C."""
    right, wrong = fault
    files = subject.sources.step_files
    assert right in files[f"{subject.name}.c"]
    return {**files, f"{subject.name}.c": files[f"{subject.name}.c"].replace(right, wrong)}


@pytest.mark.long
@needs_z3
@each_fault
def test_z3_notices_a_fault(fault):
    """With a fault the solver's proof does not go through."""
    subject = Subject(RK1)
    result, detail = provers.judged_by_z3(subject, faulty(subject, fault), MODELS[MODEL])
    assert result == "fails"
    assert NAME in detail


@needs_eva
@each_fault
def test_eva_notices_a_fault(fault, tmp_path):
    """With a fault Eva raises an alarm where it raises none for what is printed."""
    subject = Subject(RK1)
    provers.write_harness(subject.sources, tmp_path)
    (tmp_path / f"{NAME}.c").write_text(faulty(subject, fault)[f"{NAME}.c"])
    assert provers.judged_by_eva(NAME, tmp_path, MODEL)[0] == "fails"


@needs_eva
def test_eva_proves_a_step(monkeypatch, tmp_path):
    """What is printed raises no alarm; the harness and the report are kept."""
    monkeypatch.setattr(provers, "MODELS", {MODEL: MODELS[MODEL]})
    (verdict,) = provers.prove_by_eva(Subject(RK1), tmp_path)
    assert (verdict.claim, verdict.result) == (f"no overflow: {MODEL}", "proved")
    assert (tmp_path / f"{NAME}_eva_gcc_x86_16.log").is_file()


@needs_z3
@pytest.mark.parametrize(
    "model", [MODEL, *(pytest.param(name, marks=pytest.mark.long) for name in MODELS if name != MODEL)]
)
@pytest.mark.parametrize(
    ("choice", "settings"),
    [
        *(pytest.param(RK1, Settings(carry=carry), id=f"{carry} carried") for carry in CARRIES),
        *(pytest.param(RK1, Settings(word=word), id=f"{word} bits") for word in (16, 64)),
        pytest.param(RK1, Settings(rounding="truncation", state="q31"), id="saturated"),
        pytest.param(RK1, Settings(multiply="high"), id="high words"),
        pytest.param(RK1, Settings(multiply="half"), id="half words"),
        pytest.param(
            Choice("euler-from-dcm"), Settings(rounding="truncation"), marks=pytest.mark.long, id="quotients"
        ),
    ],
)
def test_z3_proves_every_word_rounding_and_feedback(choice, settings, model):
    """Words, rounding, error feedback and quotients are followed; roots too, as `strapgen evidence --all` shows."""
    subject = Subject(choice, settings)
    assert provers.judged_by_z3(subject, subject.sources.step_files, MODELS[model]) == ("proved", "")


@needs_z3
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(("_asr(a_high * b_low, 16)", "_asr(a_high * b_low, 15)"), id="places"),
        pytest.param(("(a_high * b_high) + ", ""), id="upper halves"),
        pytest.param(("(uint32_t)b & 0xFFFFu", "(uint32_t)b & 0x7FFFu"), id="lower half"),
        pytest.param(("a_low * b_high", "a_low * b_low"), id="factor"),
    ],
)
def test_half_words_with_a_fault_are_not_proved(fault):
    subject = Subject(RK1, Settings(multiply="half"))
    files, source = subject.sources.step_files, f"{subject.name}.c"
    assert fault[0] in files[source]
    files = {**files, source: files[source].replace(*fault)}
    assert provers.judged_by_z3(subject, files, MODELS[MODEL])[0] == "fails"


pytest.importorskip("z3")
pytest.importorskip("pycparser")


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
def test_shifts_are_proved_to_round_down(model, defined):
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
def test_a_shift_with_a_fault_is_not_proved(fault):
    """The proof does not go through where the function is wrong or leaves something to the compiler."""
    assert not shifts_down(function("fit", fault), MODELS["64-bit processor"], PLACES)


@pytest.mark.parametrize("rounding", ["nearest", pytest.param("truncation", marks=pytest.mark.long)])
def test_the_square_root_is_proved(rounding):
    """The root is the integer next to it, or below it."""
    found = function("rt", settings=Settings(rounding=rounding))
    assert is_root(found, MODELS[MODEL], rounding == "nearest")
    assert not is_root(found, MODELS[MODEL], rounding != "nearest")


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
def test_a_square_root_with_a_fault_is_not_proved(fault):
    """Every statement of the loop matters to the proof."""
    assert not is_root(function("rt", fault), MODELS["64-bit processor"], True)


pytest.importorskip("z3")
pytest.importorskip("pycparser")


HELPERS = """
static int64_t f_shr(int64_t x, int n) { return (x < 0) ? ~(~x >> n) : (x >> n); }
static int32_t f_fit(int64_t x, int n) { return (int32_t)((x < 0) ? ~(~x >> n) : (x >> n)); }
static int32_t f_rt(int64_t square) { return (int32_t)square; }
static int64_t f_div(int64_t numerator, int64_t denominator)
{
    const int64_t top = (numerator < 0) ? -numerator : numerator;
    const int64_t below = (denominator < 0) ? -denominator : denominator;
    const int64_t quotient = (top + (below / 2)) / below;
    return ((numerator < 0) != (denominator < 0)) ? -quotient : quotient;
}
static int f_out(int32_t x, int32_t limit) { return (x < -limit) || (x > limit); }
"""


def opened(body, ranges=None, model=MODELS["64-bit processor"], word=32):
    """Return what is not proved of a function of the two words a[0] and a[1]."""
    memory = f"int{word}_t"
    text = (
        f"#include <stdint.h>\n{HELPERS}\nint f(const {memory} a[2], int32_t b[1]) {{ {body} return 0; }}\n"
    )
    functions = ParsedSource({"f.c": text}, "f.c").functions
    return KernelStatements(functions, "f", model, ranges or {}, True, 200_000).obligations()


CHECKED = (
    "const int32_t x = a[0]; const int32_t y = a[1]; if (f_out(x, 1000) || f_out(y, 1000)) { return 1; } "
)


@pytest.mark.parametrize(
    "body",
    [
        pytest.param("b[0] = a[0] + a[1];", id="sum"),
        pytest.param("b[0] = a[0] - a[1];", id="difference"),
        pytest.param("b[0] = -a[0];", id="negation of the least number"),
        pytest.param("const int64_t p = a[0] * a[1];", id="product in words"),
        pytest.param("b[0] = (int32_t)((int64_t)a[0] + a[1]);", id="narrowing"),
        pytest.param("b[0] = f_fit((int64_t)a[0] * a[1], 30);", id="too small a shift"),
        pytest.param("b[0] = f_rt(a[0]);", id="root of a negative number"),
        pytest.param("const int64_t q = f_div(1, a[0]);", id="quotient by zero"),
        pytest.param(f"{CHECKED} b[0] = (x * y) * 3000;", id="product in the checked range"),
        pytest.param(
            f"{CHECKED} int32_t m; if (x > y) {{ m = x; }} else {{ m = y; }} b[0] = m * 2147484;",
            id="branch",
        ),
    ],
)
def test_possible_overflow_stays_unproved(body):
    """Each of these fails for some input."""
    assert opened(body)


@pytest.mark.parametrize(
    "body",
    [
        pytest.param("b[0] = f_fit((int64_t)a[0] + a[1], 1);", id="mean"),
        pytest.param(f"{CHECKED} b[0] = x * y * 2000;", id="product in the checked range"),
        pytest.param(f"{CHECKED} b[0] = f_rt((int64_t)x * x + (int64_t)y * y);", id="length"),
        pytest.param(
            f"{CHECKED} const int64_t s = (int64_t)x * x + 1; b[0] = f_fit(f_div((int64_t)y * y, s), 0);",
            id="quotient",
        ),
        pytest.param(f"{CHECKED} int32_t m = x; if (y > m) {{ m = y; }} b[0] = f_rt(m - x);", id="maximum"),
        pytest.param(
            "const int64_t r = (int64_t)a[0] + a[1]; if ((r < -5) || (r > 5)) { return 2; } b[0] = f_fit(r, 0);",
            id="guard",
        ),
    ],
)
def test_safe_code_is_proved(body):
    """Each of these holds for every input."""
    assert not opened(body)


def test_a_relation_between_values_is_used():
    """x^2 - 2xy + y^2 is not negative, which no interval of a term shows."""
    body = f"{CHECKED} b[0] = f_rt((int64_t)x * x - (int64_t)x * y * 2 + (int64_t)y * y);"
    assert not opened(body)
    assert opened(body.replace("y * 2", "y * 3"))


def test_facts_of_a_branch_are_not_used_outside():
    """In the branch x is positive; behind it, it need not be."""
    body = f"{CHECKED} int32_t m = 0; if (x > 0) {{ m = f_fit(x, 1); }} b[0] = f_rt(%s);"
    assert not opened(body % "m")
    assert opened(body % "x")
    assert opened(body % "m + x")


def test_int_of_16_bits_computes_in_16_bits():
    """The product of two short words is one of int, which has 32 bits or 16."""
    body = "const int32_t p = a[0] * a[1];"
    assert not opened(body, word=16)
    assert opened(body, word=16, model=MODELS[MODEL])
    assert not opened("const int32_t p = (int32_t)a[0] * a[1];", word=16, model=MODELS[MODEL])


def test_the_range_of_an_output_is_an_obligation():
    """An output beyond the stated range is open, though nothing overflows."""
    assert not opened(f"{CHECKED} b[0] = x + y;", {"b[0]": (-2000, 2000)})
    assert opened(f"{CHECKED} b[0] = x + y;", {"b[0]": (-2000, 1999)})


def test_a_stated_range_that_does_not_hold_is_not_used():
    """The range of a value is a hint: what is computed from it stays open where the hint is wrong."""
    body = f"{CHECKED} const int32_t s = x + y; b[0] = s * 2000000;"
    assert opened(body, {"s": (-1000, 1000)})
