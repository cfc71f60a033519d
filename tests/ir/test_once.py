"""A property that is worked out once."""

from strapgen.ir.program import once


class Counted:
    """Counts how often its value is worked out."""

    times = 0

    @once
    def value(self) -> int:
        """The number of the time at which it was worked out."""
        self.times += 1
        return self.times


def test_a_value_is_worked_out_once_for_each_object():
    first, second = Counted(), Counted()
    assert [first.value, first.value, second.value] == [1, 1, 1]
    assert first.times == second.times == 1


def test_the_class_has_the_property_with_its_docstring():
    assert isinstance(Counted.value, once)
    assert Counted.value.__doc__ == "The number of the time at which it was worked out."
