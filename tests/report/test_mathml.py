"""Formulas in MathML: every sign of the LaTeX is there, and every part of it is well formed."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import pytest

from strapgen import pipeline
from strapgen.catalogue import choose, standard
from strapgen.report.mathml import equations, mathml
from strapgen.results.display.formulas import as_latex

#: Identifiers of several letters: functions and labels of elements.
FUNCTIONS = {"sin", "cos", "max", "sinc", "atan", "direction", "wrapped"}


def elements(latex):
    rows = equations(latex)
    return [
        element
        for row in rows
        for part in (row.left, *row.parts)
        for element in ElementTree.fromstring(part).iter()
    ]


@pytest.mark.parametrize("choice", list(standard()))
def test_every_formula_of_the_catalogue_keeps_its_signs(choice):
    kernel = pipeline.derive(choice)
    latex = as_latex(kernel)
    found = elements(latex)
    tags = [element.tag for element in found]
    assert tags.count("mfrac") == len(re.findall(r"\\t?frac\b", latex))
    assert tags.count("msqrt") == latex.count(r"\sqrt")
    assert tags.count("msup") + 2 * tags.count("msubsup") + tags.count("msub") == len(
        re.findall(r"(?<!\\)[\^_]", latex)
    )
    texts = [(element.text or "").strip() for element in found if element.tag == "mo"]
    assert texts.count("+") == latex.count("+")
    assert texts.count("−") == latex.count("-")
    assert texts.count("×") == latex.count(r"\times")
    plain = {
        element.text
        for element in found
        if element.tag == "mi" and not element.get("class") and len(element.text) > 1
    }
    labels = {
        part
        for signal in (*kernel.inputs, *(stage.signal for stage in (*kernel.stages, *kernel.outputs)))
        for name in signal.elements
        for part in name.split("_")
    }
    assert plain <= FUNCTIONS | labels


@pytest.mark.parametrize(
    ("latex", "expected"),
    [
        (
            r"\mathbf{d}_{1}^{T}",
            '<msubsup><mi class="bold" mathvariant="normal">d</mi><mn>1</mn><mi>T</mi></msubsup>',
        ),
        (r"x^2", "<msup><mi>x</mi><mn>2</mn></msup>"),
        (r"a < b", "<mi>a</mi><mo>&lt;</mo><mi>b</mi>"),
        (r"\frobnicate x", "<mi>frobnicate</mi><mi>x</mi>"),
        (r"\text{if } x", "<mtext>if </mtext><mi>x</mi>"),
        (r"\mathit{row\_1}_{x}", '<msub><mi class="words" mathvariant="normal">row 1</mi><mi>x</mi></msub>'),
        (r"\frac{1}{2", '<mstyle displaystyle="true"><mfrac><mn>1</mn><mn>2</mn></mfrac></mstyle>'),
        ("", ""),
    ],
)
def test_formulas_are_read_as_tex_reads_them(latex, expected):
    assert mathml(latex) == f"<math>{expected}</math>"


def test_cases_have_a_brace_and_two_columns():
    found = list(
        ElementTree.fromstring(
            mathml(r"\begin{cases} a & \text{for}\: x \leq 0 \\- a & 1 \end{cases}")
        ).iter()
    )
    assert [element.tag for element in found].count("mtr") == 2
    assert [element.tag for element in found].count("mtd") == 4
    assert any(element.tag == "mo" and element.text == "{" for element in found)


def test_broken_lines_are_one_equation():
    kernel = pipeline.derive(choose("dcm", "rk4", 2))
    latex = as_latex(kernel)
    rows = equations(latex)
    assert len(rows) == latex.count("&=") < latex.count("\\\\\n") + 1
    assert len(rows[0].parts) == 7  # five definitions, of which two are sums of two terms
