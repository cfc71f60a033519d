"""The catalogue: names, choices, and what every kernel in it must satisfy."""

import subprocess
import sys

import pytest
import sympy as sp
from derived import kernel as derived

from strapgen import catalogue
from strapgen.catalogue import ALGORITHMS, KERNELS, MOST_INCREMENTS, STANDARD_METHODS, Choice, choose
from strapgen.ir.exceptions import InputError
from strapgen.ir.program import RESOLUTION

STANDARD = catalogue.standard()
EVERY = pytest.mark.parametrize("choice", STANDARD, ids=lambda choice: choice.kernel)


def test_the_default_is_fourth_order_on_two_increments():
    assert choose("euler") == Choice("euler", "rk4", 2)
    assert choose("dcm", "rk1", 8).kernel == "dcm-rk1-8"
    assert choose("dcm-from-euler") == Choice("dcm-from-euler")
    assert choose("dcm-from-euler").kernel == "dcm-from-euler"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("quaternion",), ["algorithm 'quaternion'", "euler", "strapgen list kernels shows all"]),
        (("dcm", "rk5"), ["method 'rk5'", "rk4", "strapgen list methods shows all"]),
        (("dcm", "rk4", 0), ["increments", "0", "1 to 8"]),
        (("dcm", "rk4", MOST_INCREMENTS + 1), ["increments", "9", "1 to 8"]),
        (("dcm", "rk4", 2.0), ["increments", "2.0", "1 to 8"]),
        (("dcm", "rk4", True), ["increments", "True", "1 to 8"]),
        (("error-matrix", "rk4"), ["error-matrix", "method", "rk4", *ALGORITHMS]),
        (("error-matrix", None, 2), ["error-matrix", "increments", "2", *ALGORITHMS]),
    ],
)
def test_a_wrong_choice_is_told_with_what_is_allowed(arguments, named):
    with pytest.raises(InputError) as caught:
        choose(*arguments)
    message = str(caught.value)
    assert "\n" not in message
    assert [word for word in named if word not in message] == []


def test_orthonormalizations_of_each_algorithm():
    assert catalogue.orthonormalizations("dcm") == [
        "dcm-orthonormalize",
        "dcm-orthonormalize-optimal",
        "dcm-orthonormalize-first-order",
        "dcm-orthonormalize-second-order",
    ]
    for algorithm in ("euler", "cayley-klein"):
        normalize = f"{algorithm}-normalize"
        assert catalogue.orthonormalizations(algorithm) == [normalize, f"{normalize}-first-order"]


def test_the_standard_catalogue_holds_everything_once():
    names = [choice.kernel for choice in STANDARD]
    assert (
        len(set(names))
        == len(names)
        == len(ALGORITHMS) * len(STANDARD_METHODS) + sum(recipe.standard for recipe in KERNELS.values())
    )
    identifiers = {name.replace("-", "_") for name in names}
    assert len(identifiers) == len(names)


@pytest.mark.long
@EVERY
def test_a_kernel_is_what_was_chosen(choice):
    kernel = derived(choice)
    assert kernel.name == choice.kernel
    assert kernel.identifier.isidentifier()
    assert kernel.title and kernel.source
    # What stands in a generated header must lead back to the kernel.
    name, *options = (kernel.arguments or kernel.name).split()
    given = dict(zip(options[::2], options[1::2], strict=True))
    increments = given.get("--increments")
    assert choose(name, given.get("--method"), increments and int(increments)) == choice


@EVERY
def test_a_kernel_is_exact_and_closed(choice):
    kernel = derived(choice)
    known = [name for signal in kernel.inputs for name in signal.elements]
    for stage in (*kernel.stages, *kernel.outputs):
        assert len(stage.expressions) == stage.signal.size
        for expression in stage.expressions:
            assert not expression.has(sp.Float)
            assert {symbol.name for symbol in expression.free_symbols} <= {*known, RESOLUTION}
            assert all(symbol.is_real for symbol in expression.free_symbols)
        known += stage.signal.elements
    assert len(set(known)) == len(known)  # names serve as variables in generated code


@EVERY
def test_signals_are_explained(choice):
    kernel = derived(choice)
    for signal in (*kernel.inputs, *(stage.signal for stage in kernel.outputs)):
        assert signal.meaning
        if signal.shape == (3, 3) and "direction cosine" in signal.meaning:
            assert "body to reference" in signal.meaning
        if signal.shape == (4,) and signal.name != "transition":
            assert ("scalar last" in signal.meaning) != ("scalar first" in signal.meaning)
            assert ("scalar last" in signal.meaning) == signal.elements[3].endswith("_s")


@pytest.mark.parametrize("choice", STANDARD[:12], ids=lambda choice: choice.kernel)
def test_companions_are_in_the_catalogue_and_fit(choice):
    kernel = derived(choice)
    state = kernel.inputs[0]
    attitude_step = kernel.attitude_step
    product = derived(choose(attitude_step.product))
    assert [signal.shape for signal in product.inputs] == [state.shape, state.shape]
    assert attitude_step.orthonormalize in catalogue.orthonormalizations(choice.name)
    assert len(attitude_step.identity) == state.size
    if attitude_step.attitude is not None:
        attitude = derived(choose(attitude_step.attitude))
        assert attitude.inputs[0] == state
        assert attitude.outputs[0].signal.shape == (3, 3)


def test_names_are_listed_without_computer_algebra():
    code = (
        "import sys; from strapgen import catalogue; catalogue.standard(); catalogue.choose('euler');"
        "print('sympy' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "False"
