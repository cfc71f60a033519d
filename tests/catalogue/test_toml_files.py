"""TOML files of users."""

from decimal import Decimal

import pytest

from strapgen.catalogue import toml_models
from strapgen.ir.exceptions import InputError


def test_a_file_keeps_the_digits_of_its_numbers(tmp_path):
    place = tmp_path / "numbers.toml"
    place.write_bytes(b"\xef\xbb\xbfa = 0.1\r\nb = 2\r\n")  # as an editor on Windows writes it
    assert toml_models.content(place, "a file", 100) == {"a": Decimal("0.1"), "b": 2}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"a = 1\n" * 20, "is over 100 bytes long; a file is shorter"),
        (b"a = \xff", "is not UTF-8 (byte 4)"),
        (b"a = ", "is not TOML ("),
        (b"a = 1\na = 2", "is not TOML ("),
        (None, "cannot be read ("),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_line(data, message, tmp_path):
    place = tmp_path / "file.toml"
    if data is not None:
        place.write_bytes(data)
    with pytest.raises(InputError) as error:
        toml_models.content(place, "a file", 100)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
