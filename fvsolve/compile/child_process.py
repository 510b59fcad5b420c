"""Command and environment of Python processes that import nothing from the present folder."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGE_PARENT = Path(__file__).resolve().parents[2]
# environment variable of Python: the present folder is not searched for modules
SAFE_PATH = "PYTHONSAFEPATH"


def python_command(*arguments: str) -> list[str]:
    """Command line of a Python process with the given arguments, such as "-m", "fvsolve".

    Without the option -P such a process would import any file of the present folder that has the name of a module.
    """
    return [sys.executable, "-P", *arguments]


def python_environment() -> dict[str, str]:
    """Environment in which a Python process finds the modules of this one, and none in the present folder."""
    return os.environ | {"PYTHONPATH": os.pathsep.join(module_folders()), SAFE_PATH: "1"}


def module_folders() -> list[str]:
    """Folders of modules of this process, without the present folder unless fvsolve itself is in it."""
    package, present = str(PACKAGE_PARENT), _present_folder()
    folders = [str(Path(folder).absolute()) for folder in sys.path if folder]
    return list(
        dict.fromkeys(
            [*(folder for folder in folders if folder == package or folder != present), package]
        )
    )


def forget_present_folder() -> None:
    """Remove the present folder, which `python -m` adds, from the folders of modules, unless fvsolve is in it."""
    if not sys.flags.safe_path and sys.path[:1] == [_present_folder()] != [str(PACKAGE_PARENT)]:
        del sys.path[0]


def _present_folder() -> str:
    try:
        return str(Path.cwd())
    except OSError:  # the folder was deleted
        return ""


@contextlib.contextmanager
def safe_path() -> Iterator[None]:
    """Context in which Python processes of `multiprocessing` import nothing from the present folder."""
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before
