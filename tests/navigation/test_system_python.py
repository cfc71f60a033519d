"""The class of a described system in Python: values go from one format to another."""

from __future__ import annotations

from dataclasses import replace

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.navigation.systems.system_generation import _moved


def test_a_value_is_moved_by_the_places_between_two_formats_and_held_in_the_word_of_its_destination():
    interface = pipeline.compile(choose("euler-product"), "c-fixed", Settings(word=16)).fixed
    there = replace(interface.inputs[0], format=Format(16, 12))
    finer, coarser = replace(there, format=Format(32, 20)), replace(there, format=Format(16, 9))
    assert _moved("a.b", there, finer) == f"_moved(a.b, 8, {2**31 - 1})"
    assert _moved("a.b", there, coarser) == f"_moved(a.b, -3, {2**15 - 1})"
    assert _moved("a.b", there, there) == "a.b"
    assert _moved("a.b", None, finer) == _moved("a.b", finer, None) == "a.b"
