"""The exceptions of strapgen; each message is one line that names the value at fault and what is allowed."""


class StrapgenError(Exception):
    """Base of every error that strapgen raises on purpose.

    Examples
    --------
    >>> from strapgen import choose
    >>> try:
    ...     choose("eulr")
    ... except StrapgenError as error:
    ...     print(str(error)[:60])
    algorithm 'eulr' is not known (did you mean euler?); allowed:
    """


class InputError(StrapgenError, ValueError):
    """A name, number, shape or file that strapgen cannot use.

    Examples
    --------
    >>> issubclass(InputError, ValueError)
    True
    """

    #: Whether a name is not known; a package that cannot be used may have it.
    unknown_name = False
    #: Whether it is about what a file holds, whose keys are no options of a command.
    in_file = False


class InputTypeError(StrapgenError, TypeError):
    """A value of a type that strapgen cannot use.

    Examples
    --------
    >>> issubclass(InputTypeError, TypeError)
    True
    """


class CompilerError(StrapgenError, RuntimeError):
    """No C compiler was found, or it refused the code.

    Examples
    --------
    >>> issubclass(CompilerError, StrapgenError)
    True
    """


class MissingExtraError(StrapgenError, ImportError):
    """An optional dependency is not installed.

    Examples
    --------
    >>> issubclass(MissingExtraError, StrapgenError)
    True
    """


for _error in (StrapgenError, InputError, InputTypeError, CompilerError, MissingExtraError):
    _error.__module__ = "strapgen"  # where users find them, and what a traceback shows
