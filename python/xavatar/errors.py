"""What can go wrong. Every exception is an ``xavatar.Error`` with a ``remedy`` in the words of this module's caller.

``str(error)`` names the file or the argument, what was found, what was expected, and the next step.
"""

from __future__ import annotations


class Error(Exception):
    """Anything that the library refuses."""

    #: What to do, where that is known.
    remedy: str | None
    #: The frame in which it happened, as ``split/sequence/number``, if it was one.
    frame: str | None

    def __init__(self, message: str, remedy: str | None = None, frame: str | None = None) -> None:
        super().__init__(message)
        self.remedy = remedy
        self.frame = frame


class ArgumentError(Error, ValueError):
    """An argument or a setting that is out of range, or of the wrong shape."""


class FileError(Error, OSError):
    """A file that the system does not let be read or written."""


class MissingError(Error, FileNotFoundError):
    """A file or a folder that has to be there and is not."""


class FormatError(Error, ValueError):
    """A file that is broken, or that holds something else than is needed."""


class RefusedError(FormatError):
    """A file that asks for code to be run, or a decompression bomb."""


class UnfitError(Error):
    """Data that can be read, and that nothing good can be made of."""


class TrainingError(Error):
    """A loss that is no number any more, or a field without a surface."""
