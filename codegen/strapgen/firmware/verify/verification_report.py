"""Lays out what `strapgen verify` found."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from strapgen.firmware.verify.verification import Verification
from strapgen.firmware.verify.whole_verification import WholeVerification
from strapgen.ir.decimals import places_above
from strapgen.results.report import Report

#: Why there are no figures of calls.
_NOT_RUN = "not compiled, since it differs; --run-differing compiles and runs it as it stands"


def verification_report(result: Verification) -> Report:
    """Return a verification as a report."""
    return Report(lambda: _text(result), lambda: _data(result))


def _data(result: Verification) -> dict[str, Any]:
    return {
        "file": str(result.file),
        "in_step": result.in_step,
        "differences": list(result.differences),
        "max_ulp": result.max_ulp,
        "bound_ulp": result.bound_ulp,
        "holds": result.holds,
        "calls": result.calls,
        "wrong_calls": result.wrong,
    }


def whole_verification_report(result: WholeVerification) -> Report:
    """Return the verification of a whole as a report."""

    def data() -> dict[str, Any]:
        return {
            "header": str(result.header),
            "files": result.files,
            "differences": list(result.differences),
            "holds": result.holds,
            "stages": [_data(stage) for stage in result.stages],
        }

    def text() -> str:
        state = "out of step" if result.differences else "in step"
        lines = [*result.differences, f"{result.header}: {result.files} files, {state} with the command"]
        for stage in result.stages:
            if stage.max_ulp is None:
                lines.append(f"{stage.file.stem}: {_NOT_RUN}")
            else:
                lines.append(f"{stage.file.stem}: {_calls(stage)}")
        return "\n".join(lines)

    return Report(text, data)


def _text(result: Verification) -> str:
    lines = [*result.differences]
    lines.append(f"{result.file}: {'in step' if result.in_step else 'out of step'} with its command")
    return "\n".join([*lines, _NOT_RUN if result.max_ulp is None else _calls(result)])


def _calls(result: Verification) -> str:
    """Return what the calls of a function returned."""
    right = f"{result.calls - result.wrong} of {result.calls} calls return what they must"
    bound = "" if result.bound_ulp is None else f", certified {places_above(Fraction(result.bound_ulp))}"
    return f"{right}; error {result.max_ulp:.4f} of the last place{bound}"
