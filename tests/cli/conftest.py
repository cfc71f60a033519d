"""What the tests of the command line share."""

from shared_results import shared_results  # noqa: F401
