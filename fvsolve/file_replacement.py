"""Replacement of files in a single step: a reader, or a later program after a kill, finds the old or the new file."""

import itertools
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

NUMBERS = itertools.count()
# name of a temporary file: process, number, ending of the new file
TEMPORARY = re.compile(r"\.(\d+)-\d+\.tmp(\..*)?")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Context manager that yields a path in the folder of `path`, of a new file that replaces `path` at the end.

    The new path has the ending of `path`. If the block raises, `path` is unchanged. A link is followed, and a device or
    pipe is written without replacement. The name in an OSError is `path`.
    """
    target = Path(path)
    if target.is_symlink():
        target = target.resolve()
    if target.exists() and not target.is_file():
        yield target
        return
    fresh = target.with_name(f".{os.getpid()}-{next(NUMBERS)}.tmp{target.suffix}")
    try:
        yield fresh
        with suppress(OSError):  # no earlier file
            os.chmod(fresh, stat.S_IMODE(target.stat().st_mode))
        os.replace(fresh, target)
    except OSError as error:
        if error.filename is not None and Path(os.fsdecode(error.filename)) == fresh:
            error.filename = str(path)
            error.filename2 = None
        raise
    finally:
        with suppress(OSError):
            fresh.unlink()


def write_file(path: str | Path, data: str | bytes) -> None:
    """Write a text in UTF-8, or bytes, in a single step."""
    with replacing(path) as fresh:
        fresh.write_bytes(data.encode() if isinstance(data, str) else data)


def remove_unfinished(folder: Path, process: int | None = None) -> None:
    """Delete temporary files that killed processes left in a folder; process : only those of this process."""
    for path in folder.glob(".*.tmp*"):
        match = TEMPORARY.fullmatch(path.name)
        if match and process in (None, int(match[1])):
            path.unlink(missing_ok=True)
