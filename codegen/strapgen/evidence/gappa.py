"""Proves the error bounds of a call with Gappa, and checks the proof with Coq, so that Gappa need not be trusted.

A bound says how far the outputs are from exact arithmetic on the same inputs. Gappa takes the rules of a script as
hypotheses of the theorem that it writes for Coq. Here they are lemmas, which Coq proves as identities of polynomials:
what is left of hypotheses are the ranges of the inputs.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

from strapgen.evidence.collection import Result, Subject, Tool, Verdict, verdict
from strapgen.evidence.gappa_scripts import DEGREES, CannotFollowError, Script, fixed_script, floating_script
from strapgen.fixedpoint.floating.bounds import rounding_bounds
from strapgen.fixedpoint.floating.errors import NUMBERS

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

#: Processor time, or where it has no limit time, after which a proof is given up, and bits of the ends of intervals.
SECONDS, PRECISION = 60, 256
#: What a bound may differ from the header's before the difference is told.
_CLOSE = Fraction(1, 20)


def _version() -> str:
    return _run(["--version"]).stdout.split()[-1]


GAPPA = Tool("Gappa", ("gappa",), "gappa", _version)


def check(subject: Subject, folder: Path) -> list[Verdict]:
    """Have Gappa prove the error bounds of a call in fixed point, in double and in float."""
    verdicts = [
        _verdict(subject.name, "one step", folder / "one_step.g", lambda: [fixed_script(subject.fixed)])
    ]
    for number in NUMBERS:
        write = partial(_floating, subject, number)
        file = folder / f"one_step_{number}.g"
        verdicts.append(_verdict(subject.name, f"one step in {number}", file, write))
    return verdicts


def _floating(subject: Subject, number: str) -> Iterator[Script]:
    """Yield scripts of a call in floating point, the quicker ones first."""
    rounding = rounding_bounds(subject.program, number)
    return (floating_script(subject.program, rounding, degree) for degree in DEGREES)


def _verdict(kernel: str, case: str, file: Path, write: Callable[[], Iterable[Script]]) -> Verdict:
    """Return the verdict of Gappa on the first script with which it proves the bounds, or on the last."""

    def judge() -> tuple[Result, str]:
        outcome: tuple[Result, str] = "fails", "no script"
        try:
            for script in write():
                file.write_text(
                    f"# Run: gappa -Eprecision={PRECISION} {file.name}\n{script.question()}",
                    encoding="utf-8",
                    newline="\n",
                )
                outcome = compare_bounds(script, *proved_bounds(file))
                if outcome[0] == "proved":
                    break
        except CannotFollowError as reason:
            return "not examined", str(reason)
        return outcome

    return verdict(kernel, f"error bound: {case}", GAPPA, judge)


def proved_bounds(file: Path) -> tuple[list[Fraction], str]:
    """Return the bound that Gappa proves of each expression of a script, and its complaint.

    There are fewer bounds where it has none. It complains of a rule that is no identity, or says why it gave up.
    """
    outcome = _run([f"-Eprecision={PRECISION}", str(file)])
    if outcome.returncode < 0:
        return [], f"no answer in {SECONDS} s"
    lines = (outcome.stdout + outcome.stderr).splitlines()
    for line in lines:  # Gappa takes a rule on trust, and says so
        if "not trivially equal" in line or "assumed to be nonzero" in line or line.startswith("Error"):
            return [], line.removeprefix("Warning: ")
    bounds = []
    for line in lines:
        ends = re.search(r" in \[([^, ]+), ([^] ]+)\]$", re.sub(r" \{[^}]*\}", "", line))
        if ends:
            bounds.append(max(abs(_exactly(end)) for end in ends.groups()))
    return bounds, ""


def compare_bounds(script: Script, bounds: Sequence[Fraction], complaint: str) -> tuple[Result, str]:
    """Compare the bounds that Gappa proves with those that the header states.

    With the result come the bounds that are the closest to the header's, or farthest above.
    """
    if complaint:
        return "fails", complaint
    stated = [*script.goals.values()]
    if len(bounds) != len(stated):
        return "fails", "Gappa finds no bound of every output"
    pairs = list(zip(bounds, stated, strict=True))
    if any(bound > limit for bound, limit in pairs):
        return "fails", _compare([pair for pair in pairs if pair[0] > pair[1]])
    return "proved", _compare([pair for pair in pairs if pair[1]])


def _compare(pairs: Sequence[tuple[Fraction, Fraction]]) -> str:
    """Return the largest bounds beside those of the header, and their ratio."""
    if not pairs:
        return "exact"
    bound, limit = max(pairs, key=lambda pair: (pair[0] / pair[1] if pair[1] else 0, pair[0]))
    text = f"{float(bound):.4g}, the header states {float(limit):.4g}"
    if not limit:
        return text
    ratio = bound / limit
    return f"{text}, ratio {float(ratio):.3f}{'' if abs(ratio - 1) <= _CLOSE else ', more than 5 % apart'}"


def _exactly(text: str) -> Fraction:
    """Return a number as Gappa prints it: an integer, or one times a power of two."""
    integer, _, exponent = text.partition("b")
    return int(integer) * Fraction(2) ** int(exponent or 0)


def _run(arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    limits: dict[str, Any] = {"timeout": SECONDS}
    if resource is not None:
        limits = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))}
    words = ["gappa", *arguments]
    try:
        return subprocess.run(words, capture_output=True, text=True, check=False, **limits)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(words, -1, "", "")


#: Proves that two expressions are equal, whatever the rounded values in them are.
_IDENTITY = """Require Import Reals Field.
Require Import Gappa.Gappa_library.
Ltac identity :=
  intros;
  repeat match goal with |- context [rounding_fixed ?a ?b ?x] =>
    let rounded := fresh in generalize (rounding_fixed a b x); intro rounded end;
  unfold float2R, Float1, Defs.F2R; simpl; unfold Z.pow_pos; simpl; field.
"""
_LIBRARY = "Require Import Gappa.Gappa_library.\n"
#: The axioms of Coq's real numbers and of classical logic.
AXIOMS = {
    "ClassicalDedekindReals.sig_not_dec",
    "ClassicalDedekindReals.sig_forall_dec",
    "FunctionalExtensionality.functional_extensionality_dep",
    "Classical_Prop.classic",
}


def _coq_version() -> str:
    said = subprocess.run(["coqc", "--version"], capture_output=True, text=True, check=True).stdout
    return said.split("version ")[1].split()[0]


COQ = Tool("Coq", ("coqc", "gappa"), "coq, libcoq-gappa and gappa", _coq_version)


def check_by_coq(subject: Subject, folder: Path) -> list[Verdict]:
    """Have Coq check the proof of the error bound of a call; it takes half a minute, and more for a matrix."""
    if not subject.is_reference_step:
        return []

    def judge() -> tuple[Result, str]:
        return checked(fixed_script(subject.fixed), folder / "one_step.v")

    return [verdict(subject.name, "error bound: one step", COQ, judge)]


def checked(script: Script, file: Path) -> tuple[Result, str]:
    """Have Coq check the proof that Gappa finds of the claim of a script."""
    claim = file.with_suffix(".claim.g")
    claim.write_text(script.claim(), encoding="utf-8", newline="\n")
    said = subprocess.run(
        ["gappa", "-Bcoq", claim.name], cwd=file.parent, capture_output=True, text=True, check=False
    )
    if said.returncode:
        return "fails", "Gappa finds no proof"
    text, count = without_hypotheses(said.stdout)
    file.write_text(f"(* Run: coqc {file.name} *)\n{text}", encoding="utf-8", newline="\n")
    proof = subprocess.run(["coqc", file.name], cwd=file.parent, capture_output=True, text=True, check=False)
    if proof.returncode:
        return "fails", " ".join(proof.stderr.split())[-200:]
    if strange := extra_axioms(proof.stdout):
        return "fails", f"the proof needs {', '.join(strange)}"
    return "proved", f"Gappa's proof and the {count} identities in it; axioms of the real numbers alone"


def extra_axioms(said: str) -> list[str]:
    r"""Return the assumptions of a theorem beside the axioms of the real numbers, from the messages of Coq.

    >>> extra_axioms("Axioms:\nClassical_Prop.classic : forall P : Prop, P\na1 : (x = y)%R\n")
    ['a1']
    """
    _, told, axioms = said.partition("Axioms:\n")
    if not told:
        return ["what Coq does not tell"]
    return sorted({*re.findall(r"^([\w.]+)(?= :|$)", axioms, flags=re.MULTILINE)} - AXIOMS)


def without_hypotheses(proof: str) -> tuple[str, int]:
    """Return a proof of Gappa with lemmas in place of hypotheses, and their number; it ends with its assumptions."""
    text = proof.replace(_LIBRARY, _IDENTITY, 1)
    text, count = re.subn(
        r"^Hypothesis (\w+) : (.*)\.$", r"Lemma \1 : \2.\nProof. identity. Qed.", text, flags=re.MULTILINE
    )
    return f"{text}\nPrint Assumptions l1.\n", count
