"""Exceptions: all are `Error`, and also the built-in exceptions that Python programs expect."""


class Error(Exception):
    """Something that echocast cannot do; the message says what was found and what is allowed."""


class ArgumentError(Error, ValueError):
    """An argument, option or name that is not allowed."""


class FormatError(Error, ValueError):
    """A file or text whose content is wrong."""


class UnsupportedError(Error, ValueError):
    """A valid request that this build or format does not support."""


class FileError(Error, OSError):
    """The operating system refused: no permission, a full disk."""


class NotFoundError(FileError, FileNotFoundError):
    """A file that does not exist."""


class OutOfMemoryError(Error, MemoryError):
    """The system is out of memory."""


class CancelledError(Error):
    """A callback asked to stop."""
