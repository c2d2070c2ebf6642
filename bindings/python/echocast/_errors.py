"""Exceptions: all are `Error`, and also what Python programs expect of their kind."""


class Error(Exception):
    """Something that echocast cannot do; its text says what was found and what is allowed."""


class ArgumentError(Error, ValueError):
    """An argument, option or name that is not allowed."""


class FormatError(Error, ValueError):
    """A file or text whose content is wrong."""


class UnsupportedError(Error, ValueError):
    """Something understood that this build or format cannot do."""


class FileError(Error, OSError):
    """The operating system refused: no permission, a full disk."""


class NotFoundError(FileError, FileNotFoundError):
    """A file that does not exist."""


class OutOfMemoryError(Error, MemoryError):
    """The system is out of memory."""


class CancelledError(Error):
    """A callback asked to stop."""
