"""The exceptions of strapgen; each message is one line that names the value at fault and what is allowed."""


class StrapgenError(Exception):
    """Base of every error that strapgen raises on purpose."""


class InputError(StrapgenError, ValueError):
    """A name, number, shape or file that strapgen cannot use."""

    #: Whether a name is not known; a package that cannot be used may have it.
    unknown_name = False
    #: Whether it is about what a file holds, whose keys are no options of a command.
    in_file = False


class InputTypeError(StrapgenError, TypeError):
    """A value of a type that strapgen cannot use."""


class CompilerError(StrapgenError, RuntimeError):
    """No C compiler was found, or it refused the code."""


class MissingExtraError(StrapgenError, ImportError):
    """An optional dependency is not installed."""


for _error in (StrapgenError, InputError, InputTypeError, CompilerError, MissingExtraError):
    _error.__module__ = "strapgen"  # where users find them, and what a traceback shows
