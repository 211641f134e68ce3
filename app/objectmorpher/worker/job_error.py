"""Why a job failed: in a sentence, and whether it was our fault, the request's or the machine's."""

from __future__ import annotations

import errno
import logging
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace

log = logging.getLogger(__name__)

OURS = ("objectmorpher", "objectmorpher_core")  # packages
# What the system says of a wrong request: no other try makes it right.
LASTING = (errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG, errno.EINVAL)


@dataclass(frozen=True)
class JobError:
    """Why a job failed."""

    name: str  # the exception's type, or "Crash"
    sentence: str  # for the status line
    trace: str  # for "Details" and the log
    retry: Callable[[], None] | None = None  # asks for the same once more, where that may help
    is_expected: bool = False  # one of our own errors: the request was at fault, not the program
    may_pass: bool = False  # the machine was at fault: the same may succeed on another try

    @classmethod
    def of(cls, error: Exception, what: str) -> JobError:
        """Make it from an exception that is being handled; `what` failed."""
        name = type(error).__name__
        # Of others' kinds some are values' errors, too: numpy's of a singular matrix is one.
        is_ours = type(error).__module__.partition(".")[0] in OURS
        is_expected = is_ours and isinstance(error, ValueError)
        sentence = str(error) or f"{what} failed ({name})"
        return cls(
            name, sentence, traceback.format_exc(),
            is_expected=is_expected, may_pass=_may_pass(error),
        )  # fmt: skip

    def retried_by(self, again: Callable[[], None]) -> JobError:
        """Return the same error with `again` as its remedy if another try may help."""
        return replace(self, retry=again) if self.may_pass else self

    def write_log(self, title: str) -> None:
        """Log the failure of `title`, as an error of the program's unless it was expected."""
        level = logging.INFO if self.is_expected else logging.ERROR
        log.log(level, "%s failed: %s\n%s", title, self.sentence, self.trace)


def _may_pass(error: BaseException | None) -> bool:
    """Whether the system failed, and not for good: a full disk, a lost drive, too little memory.

    An error without a number is not the system's: Pillow calls a broken picture an OSError.
    """
    if error is None or isinstance(error, MemoryError):
        return error is not None
    if isinstance(error, OSError) and error.errno is not None and error.errno not in LASTING:
        return True
    return _may_pass(error.__cause__)
