"""Back ends themselves are tested in every language."""

import pytest
from languages import cases

from strapgen.run.backends import BACKENDS


@pytest.fixture(params=cases(BACKENDS))
def backend_name(request: pytest.FixtureRequest) -> str:
    """Name of a back end: a test that asks for it runs on every one."""
    return str(request.param)
