"""Standard streams of a command: a missing, closed or full stream does not stop its work."""

import contextlib
import errno
import io
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any


class SafeStream:
    """Text stream that discards all text after its first error, so that a command finishes its work.

    error : that error, None without one
    """

    def __init__(self, stream: Any) -> None:
        self.stream, self.error = stream, None

    def write(self, text: str) -> int:
        """Write a text; returns its length."""
        self._attempt(self.stream.write, text)
        return len(text)

    def writelines(self, texts: Iterable[str]) -> None:
        """Write texts."""
        for text in texts:
            self.write(text)

    def flush(self) -> None:
        """Write the text that is still in memory."""
        self._attempt(self.stream.flush)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def _attempt(self, action: Callable, *arguments: str) -> None:
        if self.error is not None:
            return
        try:
            action(*arguments)
        except OSError as error:
            self.error = error
            # else the end of the interpreter would fail
            with contextlib.suppress(OSError, io.UnsupportedOperation):
                null = os.open(os.devnull, os.O_WRONLY)
                os.dup2(null, self.stream.fileno())
                os.close(null)
        except ValueError:
            if not self.stream.closed:
                raise
            self.error = OSError(errno.EBADF, os.strerror(errno.EBADF))


@contextlib.contextmanager
def safe_streams() -> Iterator[SafeStream]:
    """Context manager in which all standard streams exist and accept text; yields that of standard output."""
    before = sys.stdin, sys.stdout, sys.stderr
    # else the next file would take the number, and texts of libraries would go into it
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    with contextlib.ExitStack() as opened:
        null = opened.enter_context(open(os.devnull, "r+", encoding="utf-8"))
        for stream in (sys.stdout, sys.stderr):
            # false if a caller has replaced the stream by another file object
            if hasattr(stream, "reconfigure"):
                # a terminal may have a small character set
                stream.reconfigure(errors="backslashreplace")
        sys.stdin = sys.stdin or null
        output, sys.stderr = SafeStream(sys.stdout or null), SafeStream(sys.stderr or null)
        sys.stdout = output
        try:
            yield output
        finally:
            output.flush()
            sys.stderr.flush()
            sys.stdin, sys.stdout, sys.stderr = before
