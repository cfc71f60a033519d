"""Kernels as text, LaTeX and data that SymPy reads back; colours of figures that all readers tell apart."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from fractions import Fraction
from itertools import combinations

import derived
import pytest
import sympy as sp

from strapgen import pipeline
from strapgen.catalogue import choose, standard
from strapgen.results import figures
from strapgen.results.display import formulas, latex
from strapgen.results.figures import DARK_PAPER, PAPER, contrast, linear, on_dark, to_oklab

SOME = [
    choice for choice in standard() if choice.kernel in ("euler-rk4-2", "dcm-rk2-2", "cayley-klein-rk1-2")
]
SOME += [choice for choice in standard() if choice.method is None]


@pytest.fixture(params=SOME, ids=lambda choice: choice.kernel)
def kernel(request):
    return derived.kernel(request.param)


def stages(kernel):
    return (*kernel.stages, *kernel.outputs)


@pytest.mark.long
def test_text_has_every_formula(kernel):
    lines = formulas.as_text(kernel).splitlines()
    assert lines[0] == kernel.title
    assert lines[1] == f"source: {kernel.source}"
    for signal in kernel.inputs:
        assert any(line.startswith(f"in   {signal.name} (") and signal.meaning in line for line in lines)
    for stage in kernel.outputs:
        assert f"out  {stage.signal.name} (unit {stage.signal.unit}): {stage.signal.meaning}" in lines
    for note in kernel.notes:
        assert f"note {note}" in lines
    for stage in stages(kernel):
        for name, expression in zip(stage.signal.elements, stage.expressions, strict=True):
            assert f"  {name} = {expression}" in lines


def test_latex_has_an_equation_for_every_formula(kernel):
    text = formulas.elements_latex(kernel)
    assert text.startswith("\\begin{align*}\n") and text.endswith("\n\\end{align*}")
    rows = text.splitlines()[1:-1]
    lefts = [row.partition(" &= ")[0] for row in rows if " &= " in row]
    letters = [left for left in lefts if re.fullmatch(r"q_\{\d+\}", left)]  # of what no line holds
    assert len(lefts) - len(letters) == sum(stage.signal.size for stage in stages(kernel))
    assert all(f"{letter} &=" in text and text.count(letter) > 1 for letter in letters)
    assert all(" &= " in row or row.startswith("    &\\quad {} ") for row in rows)
    assert all(row.endswith(" \\\\") for row in rows[:-1]) and not rows[-1].endswith("\\\\")
    assert text.count("{") == text.count("}")
    assert "**" not in text


def test_latex_names():
    text = formulas.elements_latex(pipeline.derive("euler", "rk1", 1))
    assert "e_{x}" in text
    assert "\\mathit{half\\_turn\\_0}_{x} &= \\frac{d_{1x}}{2}" in text


EULER = r"""
\begin{align*}
\boldsymbol{\sigma} &= \mathbf{d}_{1} + \mathbf{d}_{2}, \quad A = \boldsymbol{\sigma} \cdot \boldsymbol{\sigma}, \quad B = \mathbf{d}_{1} \cdot \mathbf{d}_{2} \\
\mathbf{p} &= (\tfrac{1}{2} - \tfrac{1}{48} A)\, \boldsymbol{\sigma} + (\tfrac{1}{3} - \tfrac{1}{48} A)\, \mathbf{d}_{1} \times \mathbf{d}_{2} \\
p_s &= 1 - \tfrac{1}{8} A - \tfrac{1}{128} A^{2} + \tfrac{1}{24} A B \\
\mathbf{e}^{+} &= \mathbf{e} \circ (\mathbf{p}, p_s)
\end{align*}
"""  # noqa: E501


def test_a_step_is_written_in_vectors_as_the_page_on_its_canonical_form_writes_it():
    assert formulas.as_latex(pipeline.derive("euler", "rk4", 2)) == EULER.strip()


def test_formulas_are_short_or_not_shown_at_a_glance():
    assert formulas.short_latex(pipeline.derive("euler", "rk4", 2)) == EULER.strip()
    short = pipeline.derive("dcm-from-euler")
    assert formulas.short_latex(short) == formulas.elements_latex(short) == formulas.as_latex(short)
    long = pipeline.derive("cayley-klein", "butcher6", 3)
    assert formulas.short_latex(long) is None
    assert formulas.as_latex(long) == formulas.elements_latex(long)


MAGNUS = r"""
\begin{align*}
\boldsymbol{\mu}_{0} &= \mathbf{d}_{1} + \mathbf{d}_{2} \\
\boldsymbol{\mu}_{1} &= -\tfrac{1}{3} \mathbf{d}_{1} + \tfrac{1}{3} \mathbf{d}_{2} \\
\boldsymbol{\phi} &= \boldsymbol{\mu}_{0} + \boldsymbol{\mu}_{0} \times \boldsymbol{\mu}_{1} \\
\mathbf{p} &= \exp(\tfrac{1}{2} \boldsymbol{\phi}) \\
\mathbf{e}^{+} &= \mathbf{e} \circ \mathbf{p}
\end{align*}
"""


def test_stages_are_sums_and_products_of_vectors():
    assert formulas.as_latex(pipeline.derive("euler", "magnus4", 2)) == MAGNUS.strip()
    text = formulas.as_latex(pipeline.derive("dcm", "butcher6", 3))
    assert text.count(" &= ") == 5 + 7 + 6 + 2  # rates at nodes, slopes, points, transition and product
    assert r"\mathbf{k}_{2} &= \mathbf{x}_{2} [\mathbf{w}_{1/3}]_{\times} \\" in text


def test_a_stage_that_differs_in_one_element_is_not_written_as_a_product():
    kernel = pipeline.derive("euler-product")
    assert r"&= \mathbf{e} \circ \mathbf{p}" in formulas.as_latex(kernel)
    (stage,) = kernel.outputs
    changed = replace(stage, expressions=(-stage.expressions[0], *stage.expressions[1:]))
    wrong = replace(kernel, outputs=(changed,))
    assert formulas.as_latex(wrong) == formulas.elements_latex(wrong)


@pytest.mark.long
def test_data_reads_back(kernel):
    program = derived.programs()[kernel.name]
    data = json.loads(json.dumps(formulas.KernelResult.of(kernel, program).data(), allow_nan=False))
    wanted = [
        "schema",
        "kernel",
        "title",
        "source",
        "notes",
        "inputs",
        "stages",
        "outputs",
        "operations",
        "temporaries",
    ]
    assert list(data) == wanted
    assert data["kernel"] == kernel.name
    assert data["operations"] == program.operations
    assert data["temporaries"] == program.temporaries
    assert [signal["name"] for signal in data["inputs"]] == [signal.name for signal in kernel.inputs]
    names = {name: sp.Symbol(name, real=True) for signal in kernel.inputs for name in signal.elements}
    for described, stage in zip(data["stages"] + data["outputs"], stages(kernel), strict=True):
        names |= {name: sp.Symbol(name, real=True) for name in stage.signal.elements}
        assert described["elements"] == list(stage.signal.elements)
        for name, expression in zip(stage.signal.elements, stage.expressions, strict=True):
            read = sp.sympify(described["expressions"][name], locals=names)
            assert sp.sstr(read) == sp.sstr(expression) or sp.simplify(read - expression) == 0


def test_a_program_reads_back_as_the_kernel():
    # What is printed, evaluated line by line by Python on exact numbers, is the step itself.
    kernel = pipeline.derive("dcm", "rk4", 2)
    program = derived.program(choose("dcm", "rk4", 2))
    names = [name for signal in kernel.inputs for name in signal.elements]
    values = {name: Fraction(k + 1, 7 * k + 30) for k, name in enumerate(names)}
    expected = kernel.expand({name: sp.Rational(x.numerator, x.denominator) for name, x in values.items()})
    text = formulas.program_as_text(program)
    assert text.splitlines()[1] == "operations: 63 add, 74 multiply; 36 temporaries"
    for line in text.splitlines():
        if " = " in line and "#" not in line:
            name, expression = line.strip().split(" = ")
            exact = re.sub(r"\((\d+)/(\d+)\)", r"Fraction(\1, \2)", expression)
            values[name] = eval(exact, {"Fraction": Fraction}, values)
            assert formulas.program_as_data(program)[name] == expression
    found = [
        sp.Rational(values[n].numerator, values[n].denominator) for n in kernel.outputs[0].signal.elements
    ]
    assert found == expected["next"]


def test_long_expressions_get_letters():
    """A letter stands for the same expression in all formulas, and its own formula comes before them."""
    text = formulas.elements_latex(pipeline.derive("euler", "crouch-grossman3", 2))
    rows = [row for row in text.splitlines() if " &= " in row]
    lefts = [row.partition(" &= ")[0] for row in rows]
    assert [left for left in lefts if left.startswith("q_")] == [f"q_{{{k}}}" for k in range(1, 6)]
    for left in lefts:
        if left.startswith("q_"):
            assert not any(left in row for row in rows[: lefts.index(left)])
    for part in latex.parts(text.partition("q_{1} &= ")[2].partition(" \\\\\n")[0]):
        assert latex.width(part) < latex.PAGE


#: The Web Content Accessibility Guidelines 2.1, 1.4.11, ask for this contrast of graphical objects, and 1.4.3 for that
#: of text.
GRAPHICS, TEXT = 3.0, 4.5
#: G. M. Machado et al., "A physiologically-based model for simulation of color vision deficiency", 2009, severity 1:
#: linear red, green and blue as they look without the long, the medium and the short cones.
VISION = {
    "all cones": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "no long cones": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "no medium cones": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.011820, 0.042940, 0.968881),
    ),
    "no short cones": (
        (1.255528, -0.076749, -0.178779),
        (-0.078411, 0.930809, 0.147602),
        (0.004733, 0.691367, 0.303900),
    ),
}
#: A just noticeable difference is about 0.02 in OKLab; lines are thin and far apart, and need three of them.
TOLD_APART = 0.06


def seen(colour: str, eyes: str) -> tuple[float, float, float]:
    """Return a colour in OKLab as eyes see it."""
    light = linear(colour)
    red, green, blue = (
        min(1.0, max(0.0, sum(m * c for m, c in zip(row, light, strict=True)))) for row in VISION[eyes]
    )
    return to_oklab((red, green, blue))


def nearest(colours: list[str], eyes: str) -> float:
    return min(math.dist(seen(one, eyes), seen(other, eyes)) for one, other in combinations(colours, 2))


@pytest.mark.parametrize("eyes", VISION)
def test_the_colours_of_lines_are_told_apart_by_all_eyes(eyes):
    assert nearest(figures.several_colours(8), eyes) > TOLD_APART


def test_colours_that_some_eyes_do_not_tell_apart_are_seen():
    red_and_green = ["#aa4433", "#5a6e00"]
    assert nearest(red_and_green, "all cones") > 2 * TOLD_APART
    assert nearest(red_and_green, "no medium cones") < TOLD_APART


def test_the_colours_of_lines_show_on_white_and_on_black():
    for colour in figures.several_colours(8):
        assert contrast(colour, PAPER) > GRAPHICS
        assert contrast(on_dark(colour), DARK_PAPER) > TEXT


def test_colours_from_dark_to_light_show_on_white_and_on_black():
    pytest.importorskip("matplotlib")
    from matplotlib.colors import to_hex

    for colour in map(to_hex, figures.colours(10, figures.LIGHTEST)):
        assert contrast(colour, PAPER) > 2.5  # the last of them; most are darker
        assert contrast(on_dark(colour), DARK_PAPER) > TEXT


def test_picture_maps_each_colour_for_dark_pages():
    pytest.importorskip("matplotlib")
    figure, grid = figures.grid_of_axes(1, 1, (2, 2))
    grid[0, 0].plot([0, 1], [1, 2], color=figures.COLOURS[1])
    text = figures.image(figure, "a.svg").decode()
    sheet = text[text.index("<style") : text.index("</style>")]
    body = text[text.index("</style>") :]
    used = set(re.findall(r"\b(fill|stroke): (#[0-9a-f]{6})", body))
    assert ("stroke", figures.COLOURS[1]) in used and ("fill", PAPER) in used
    for kind, colour in used:
        assert f"[style*='{kind}: {colour}'] {{ {kind}: {on_dark(colour)} !important }}" in sheet
    assert "#000000" not in text


def test_the_same_picture_is_the_same_text():
    pytest.importorskip("matplotlib")
    texts = []
    for _ in range(2):
        figure, grid = figures.grid_of_axes(1, 1, (2, 2))
        grid[0, 0].plot([0, 1], [1, 2])
        figures.title(figure, "A title")
        texts.append(figures.image(figure, "a.svg").decode())
    assert texts[0] == texts[1] and ">A title</text>" in texts[0]
    assert "matplotlib" not in texts[0].lower().replace("matplotlib.axis", "")


def test_paper_and_ink_change_places():
    assert contrast(figures.INK, PAPER) > 7 and contrast(figures.DARK_INK, DARK_PAPER) > 7
    greys = [on_dark(f"#{level:02x}{level:02x}{level:02x}") for level in range(0, 250, 10)]
    lights = [to_oklab(linear(grey))[0] for grey in greys]
    assert lights == sorted(lights, reverse=True)


def test_a_title_keeps_its_lines_and_breaks_long_ones():
    pytest.importorskip("matplotlib")
    figure, _ = figures.grid_of_axes(1, 1, (2, 2))
    figures.title(figure, "drift\nten seconds of a motion whose name is very long")
    first, *others = figure.get_suptitle().splitlines()
    assert first == "drift" and len(others) > 1
    assert " ".join(others) == "ten seconds of a motion whose name is very long"
