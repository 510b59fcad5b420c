"""Command line interface; the only package that prints or exits."""

import atexit
import copy
import errno
import gc
import os
import re
import sys
import warnings
from importlib import import_module
from pathlib import Path

from fvsolve.cli.streams import safe_streams
from fvsolve.errors import FvsolveError, visible

__all__ = ["main"]

# Command -> module that adds it to the application, in the order of the help text.
COMMANDS = dict.fromkeys(("run", "check", "list", "new", "schema", "methods", "compare", "view"), "commands") | {
    "chart": "accuracy_commands",
    "energy": "energy",
    "failure-map": "failure_map",
    "fmu": "fmu_command",
    "import": "file_commands",
    "export": "file_commands",
    "linearise": "linear_commands",
    "loop": "loop_commands",
    "methods": "methods_command",
    "optimise": "design_commands",
    "order": "accuracy_commands",
    "precompile": "file_commands",
    "quality": "quality",
    "report": "file_commands",
    "plot": "file_commands",
    "fatigue": "file_commands",
    "response": "linear_commands",
    "study": "design_commands",
    "sweep": "sweep",
    "sensitivity": "sweep",
    "calibrate": "sweep",
    "size": "design_commands",
    "stability": "stability",
    "validate": "validate_command",
}
# Command in the source of its module : name if it is not that of the function, name of the function, help text.
DECLARATION = re.compile(r'app\.command\((?:"([\w-]+)")?\)\ndef (\w+)\(.*?\n    """(.*?)"""', re.DOTALL)


def main() -> None:
    """Entry point of `fvsolve`. Every failure is a message on standard error and an exit code, without a traceback.

    Exit codes: 0 done; 1 a run stopped early or its results are wrong, an expectation or limit does not hold (it fails
    or is open), memory is exhausted, or an internal error; 2 bad input, or standard output cannot be written;
    130 interrupted.
    """
    with safe_streams() as output:
        try:
            run_command()
        except SystemExit as exit:
            output.flush()
            if exit.code or output.error is None or output.error.errno == errno.EPIPE:  # a reader may leave early
                raise
            _exit_with(f"standard output: cannot be written: {output.error.strerror}", 2)


def run_command() -> None:
    """Run the command of `sys.argv`, and exit with its code."""
    if sys.argv[1:] == ["--version"]:  # without the imports of any command
        import fvsolve

        print(f"fvsolve {fvsolve.__version__}")
        sys.exit(0)
    atexit.register(gc.freeze)  # at the end Python would search all modules for unused objects, a fifth of a short run
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # more threads of linear algebra cost time for these matrices
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # else pydantic searches all installed packages
    if sys.argv[1:2] == ["run"]:
        gc.disable()  # until `run` has imported its modules, none of which becomes unused
    before, warnings.formatwarning = warnings.formatwarning, lambda message, *_, **__: f"{visible(str(message))}\n"
    try:
        (overview() if sys.argv[1:] in ([], ["--help"]) else application(*sys.argv[1:2]))(prog_name="fvsolve")
    except FvsolveError as error:
        _exit_with(str(error), 2)
    except KeyboardInterrupt:
        _exit_with("interrupted", 130)
    except OSError as error:
        _exit_with(f"{error.filename or 'fvsolve'}: {error.strerror or error}", 2)
    except MemoryError:
        _exit_with("out of memory. Try fewer cells, fewer probes, or a longer output interval ([output] every)", 1)
    except Exception as error:  # a defect of fvsolve: print its location, so that it can be reported
        _exit_with(f"internal error in {_location(error)}: {type(error).__name__}: {error}; please report it", 1)
    finally:
        gc.enable()
        os.environ.pop("PYDANTIC_DISABLE_PLUGINS", None)
        warnings.formatwarning = before


def application(command: str = ""):
    """Typer application with the commands of the module of `command`, or with all commands for any other text."""
    for module in dict.fromkeys([COMMANDS[command]] if command in COMMANDS else COMMANDS.values()):
        import_module(f"fvsolve.cli.{module}")
    from fvsolve.cli.app import app

    app.registered_commands.sort(key=lambda info: [*COMMANDS].index(info.name or info.callback.__name__))
    return app


def overview():
    """Typer application that only prints its help: all commands, read from the sources without importing them."""
    from fvsolve.cli.app import app

    result = copy.copy(app)
    result.registered_commands = []
    sources = [Path(__file__).with_name(f"{module}.py") for module in dict.fromkeys(COMMANDS.values())]
    found = [row for path in sources for row in DECLARATION.findall(path.read_text(encoding="utf-8"))]
    for name, function, text in sorted(found, key=lambda row: [*COMMANDS].index(row[0] or row[1])):
        result.command(name or function, help=text)(lambda: None)
    return result


def _exit_with(message: str, code: int) -> None:
    print(visible(message), file=sys.stderr)
    sys.exit(code)


def _location(error: Exception) -> str:
    trace = error.__traceback__
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f"{trace.tb_frame.f_code.co_filename}, line {trace.tb_lineno}"
