"""Kernels without overflow are proved so; a fault in their C makes each proof fail."""

import pytest

from strapgen.catalogue import Choice
from strapgen.evidence.overflow import eva, solver
from strapgen.evidence.overflow.c_types import MODELS
from strapgen.evidence.subjects import Subject
from strapgen.ir.fixed_settings import CARRIES, Settings

MODEL = "16-bit int"
RK1 = Choice("euler", "rk1", 2)

NAME = "euler_rk1_2_w32"
needs_z3 = pytest.mark.skipif(not solver.TOOL.installed(), reason=f"install {solver.TOOL.package}")
needs_eva = pytest.mark.skipif(not eva.TOOL.installed(), reason=f"install {eva.TOOL.package}")

#: Texts of the C, with what a fault makes of them.
FAULTS = {
    "shift": ("+ 2, 2);", "+ 2, 1);"),
    "shift, though nothing overflows": ("(INT64_C(1) << 31), 32);", "(INT64_C(1) << 31), 31);"),
    "widening": (f"{NAME}_mul(e_x, half_turn_0_x)", "(e_x * half_turn_0_x)"),
    "sign": ("3)\n        - (int64_t)d2_x", "3)\n        + (int64_t)d2_x * 2"),
    "factor": (f"{NAME}_mul(d1_x, 3)", f"{NAME}_mul(d1_x, 30)"),
    "removed check": (f"\n        || {NAME}_out(d2_z, (INT32_C(1) << 30))", ""),
    "weaker check": (f"{NAME}_out(e_s, INT32_C(1140850688))", f"{NAME}_out(e_s, INT32_C(2140850688))"),
}

#: One fault with the quick tests, all with the long ones.
QUICK_FAULTS = [
    pytest.param(fault, id=name, marks=() if name.startswith("removed") else pytest.mark.long)
    for name, fault in FAULTS.items()
]


def faulty(subject, fault):
    """Return the files of a kernel with a fault in its C."""
    right, wrong = fault
    files = subject.sources.step_files
    assert right in files[f"{subject.name}.c"]
    return {**files, f"{subject.name}.c": files[f"{subject.name}.c"].replace(right, wrong)}


@pytest.mark.long
@needs_z3
@pytest.mark.parametrize("fault", QUICK_FAULTS)
def test_the_solver_notices(fault):
    """With a fault the solver's proof does not go through."""
    subject = Subject(RK1)
    result, detail = solver.judge(subject, faulty(subject, fault), MODELS[MODEL])
    assert result == "fails"
    assert NAME in detail


@needs_eva
@pytest.mark.parametrize("fault", QUICK_FAULTS)
def test_eva_notices(fault, tmp_path):
    """With a fault Eva raises an alarm where it raises none for what is printed."""
    subject = Subject(RK1)
    eva.write(subject.sources, tmp_path)
    (tmp_path / f"{NAME}.c").write_text(faulty(subject, fault)[f"{NAME}.c"])
    assert eva.judge(NAME, tmp_path, MODEL)[0] == "fails"


@needs_eva
def test_eva_proves(monkeypatch, tmp_path):
    """What is printed raises no alarm; the harness and the report are kept."""
    monkeypatch.setattr(eva, "MODELS", {MODEL: MODELS[MODEL]})
    (verdict,) = eva.prove(Subject(RK1), tmp_path)
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
        pytest.param(
            Choice("euler-from-dcm"), Settings(rounding="truncation"), marks=pytest.mark.long, id="quotients"
        ),
    ],
)
def test_the_solver_proves(choice, settings, model):
    """Words, rounding, error feedback and quotients are followed; roots too, as `strapgen evidence --all` shows."""
    subject = Subject(choice, settings)
    assert solver.judge(subject, subject.sources.step_files, MODELS[model]) == ("proved", "")
