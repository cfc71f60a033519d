"""Has Coq check the proof of an error bound that Gappa finds, so that nobody has to trust Gappa.

Gappa takes the rules of a script as hypotheses of the theorem that it writes. Here they are lemmas, which Coq proves as
identities of polynomials: what is left of hypotheses are the ranges of the inputs.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from strapgen.evidence.gappa_fixed import fixed_script
from strapgen.evidence.gappa_scripts import Script
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Tool, Verdict, verdict
from strapgen.ir.fixed_settings import Settings

#: The step whose proof is checked: Coq takes half a minute for it, and more for a matrix.
STEP = "euler-rk4-2"
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


def _version() -> str:
    said = subprocess.run(["coqc", "--version"], capture_output=True, text=True, check=True).stdout
    return said.split("version ")[1].split()[0]


TOOL = Tool("Coq", ("coqc", "gappa"), "coq, libcoq-gappa and gappa", _version)


def check(subject: Subject, folder: Path) -> list[Verdict]:
    """Have Coq check the proof of the error bound of a call."""
    if subject.choice.kernel != STEP or (subject.settings or Settings()) != Settings():
        return []

    def judge() -> tuple[Result, str]:
        return checked(fixed_script(subject.fixed), folder / "one_step.v")

    return [verdict(subject.name, "error bound: one step", TOOL, judge)]


def checked(script: Script, file: Path) -> tuple[Result, str]:
    """Have Coq check the proof that Gappa finds of the claim of a script."""
    claim = file.with_suffix(".claim.g")
    claim.write_text(script.claim())
    said = subprocess.run(
        ["gappa", "-Bcoq", claim.name], cwd=file.parent, capture_output=True, text=True, check=False
    )
    if said.returncode:
        return "fails", "Gappa finds no proof"
    text, count = without_hypotheses(said.stdout)
    file.write_text(f"(* Run: coqc {file.name} *)\n{text}")
    proof = subprocess.run(["coqc", file.name], cwd=file.parent, capture_output=True, text=True, check=False)
    if proof.returncode:
        return "fails", " ".join(proof.stderr.split())[-200:]
    if strange := strange_axioms(proof.stdout):
        return "fails", f"the proof needs {', '.join(strange)}"
    return "proved", f"Gappa's proof and the {count} identities in it; axioms of the real numbers alone"


def strange_axioms(said: str) -> list[str]:
    r"""Return what a theorem needs beside the axioms of the real numbers, from what Coq says of its assumptions.

    >>> strange_axioms("Axioms:\nClassical_Prop.classic : forall P : Prop, P\na1 : (x = y)%R\n")
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
