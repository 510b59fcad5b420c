"""One writer to a folder at a time. Knows the operating system's locks; knows not what is written.

The lock is the kernel's own on the file `.lock`, so it goes with the process that holds it, however that ends.
"""

from __future__ import annotations

import contextlib
from pathlib import Path

from filelock import FileLock, Timeout

from fvsolve.errors import RunError

NAME = ".lock"


def locked(folder: Path, what: str) -> FileLock:
    """The lock of a folder, held, the folder created; RunError where another holds it or nothing can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / NAME, blocking=False, thread_local=False, fallback_to_soft=False)
        lock.acquire()
    except Timeout:
        raise RunError(f"{folder} is in use: {what} still writes there; wait until it ends, stop it, or state "
                       "another place with --out DIR") from None  # fmt: skip
    except NotImplementedError:
        raise RunError(f"{folder} lies on a file system without locks; state another place with --out DIR") from None
    except OSError as error:
        raise RunError(f"{folder}: cannot be written: {error.strerror or error}; name another with --out") from None
    return lock


def let_go(lock: FileLock) -> None:
    """Release a lock that is held and take its file away; whoever waits for that file looks for a new one."""
    if lock.is_locked:
        with contextlib.suppress(OSError):  # Windows deletes no open file
            Path(lock.lock_file).unlink()
        lock.release()
