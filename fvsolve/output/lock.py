"""Lock of a folder, so that only one process writes to it.

The operating system holds the lock on the file `.lock` and releases it when the process ends in any way.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

from filelock import FileLock, Timeout

from fvsolve.errors import RunError

LOCK_FILE = ".lock"


def lock_folder(folder: Path, writer: str) -> FileLock:
    """Create a folder if needed and lock it; return the lock.

    writer : name of another user of the folder in the message, for example "a run"
    Raises RunError if another process has locked the folder, or it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK_FILE, blocking=False, thread_local=False, fallback_to_soft=False)
        lock.acquire()
    except Timeout:
        raise RunError(f"{folder} is in use: {writer} still writes there. Wait until it ends, stop it, or choose "
                       "another directory with --out DIR") from None  # fmt: skip
    except NotImplementedError:
        raise RunError(f"{folder} is on a file system without locks; choose another directory with --out DIR") from None
    except OSError as error:
        text = f"{folder}: cannot be written: {error.strerror or error}"
        raise RunError(f"{text}; choose another directory with --out DIR") from None
    return lock


def release(lock: FileLock) -> None:
    """Release a lock if it is held and delete its file; waiting processes then lock a new file."""
    if lock.is_locked:
        with contextlib.suppress(OSError):  # Windows cannot delete an open file
            Path(lock.lock_file).unlink()
        lock.release()
