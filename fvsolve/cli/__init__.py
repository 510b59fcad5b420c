"""Command line interface; the only package that prints or exits."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module

from fvsolve.errors import FvsolveError, visible

__all__ = ["main"]

# Modules that add commands to the application. A module of a single command usually has the name of the command.
COMMANDS = (
    "commands",
    "chart",
    "energy",
    "failure_map",
    "epanet_import",
    "linearise",
    "optimise",
    "order",
    "precompile",
    "report_commands",
    "response",
    "scenarios",
    "sensitivity",
    "sizing",
    "stability",
    "sweep",
)
BASIC_COMMANDS = ("run", "check", "list", "new", "schema", "methods", "compare", "view")  # commands of `commands`


def main() -> None:
    """Entry point of `fvsolve`. Every failure is a message on standard error and an exit code, without a traceback.

    Exit codes: 0 done; 1 a run stopped early or its results are wrong, an expectation or limit does not hold (it fails
    or is open), memory is exhausted, or an internal error; 2 bad input; 130 interrupted.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # false if a caller has replaced the stream by another file object
            stream.reconfigure(errors="backslashreplace")  # a terminal with a small character set must not end a run
    before, warnings.formatwarning = warnings.formatwarning, lambda message, *_, **__: f"{visible(str(message))}\n"
    try:
        for module in _modules_for(sys.argv[1:2]):
            import_module(f"fvsolve.cli.{module}")
        from fvsolve.cli.app import app

        app(prog_name="fvsolve")
    except FvsolveError as error:
        _exit_with(str(error), 2)
    except KeyboardInterrupt:
        _exit_with("interrupted", 130)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the output is gone: no message can reach it
        sys.exit(0)
    except OSError as error:
        _exit_with(f"{error.filename or 'fvsolve'}: {error.strerror or error}", 2)
    except MemoryError:
        _exit_with("out of memory. Try fewer cells, fewer probes, or a longer output interval ([output] every)", 1)
    except Exception as error:  # a defect of fvsolve: print its location, so that it can be reported
        _exit_with(f"internal error in {_location(error)}: {type(error).__name__}: {error}; please report it", 1)
    finally:
        warnings.formatwarning = before


def _modules_for(command: list[str]) -> tuple[str, ...]:
    """Modules to import for a command line: `commands` for a basic command, otherwise all modules."""
    if command and command[0] in BASIC_COMMANDS:
        return COMMANDS[:1]
    return COMMANDS


def _exit_with(message: str, code: int) -> None:
    print(visible(message), file=sys.stderr)
    sys.exit(code)


def _location(error: Exception) -> str:
    trace = error.__traceback__
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f"{trace.tb_frame.f_code.co_filename}, line {trace.tb_lineno}"
