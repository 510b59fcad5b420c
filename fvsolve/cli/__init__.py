"""The command line: the only room that prints or exits. Knows commands; computes nothing."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module

from fvsolve.errors import FvsolveError, visible

__all__ = ["main"]

COMMANDS = (  # files that add commands to the application: those of one command each bear its name, but for `map`
    "commands",
    "chart",
    "closing",
    "design",
    "energy",
    "failure_map",
    "handed",
    "linearise",
    "order",
    "response",
    "sensitivity",
    "sizing",
    "stability",
    "sweep",
    "warm",
)
PLAIN = ("run", "check", "list", "new", "schema", "methods", "compare", "view")  # commands of `commands`


def main() -> None:
    """Entry point of `fvsolve`: every failure is a message on standard error and an exit code, no traceback.

    0: done. 1: a run stopped early or an expectation failed. 2: bad input. 130: interrupted.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # not where a caller has put another file in its place
            stream.reconfigure(errors="backslashreplace")  # a terminal of few letters ends no run
    before, warnings.formatwarning = warnings.formatwarning, lambda message, *_, **__: f"{visible(str(message))}\n"
    try:
        for room in _wanted(sys.argv[1:2]):
            import_module(f"fvsolve.cli.{room}")
        from fvsolve.cli.app import app

        app(prog_name="fvsolve")
    except FvsolveError as error:
        _leave(str(error), 2)
    except KeyboardInterrupt:
        _leave("interrupted", 130)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output has gone: nobody to tell
        sys.exit(0)
    except OSError as error:
        _leave(f"{error.filename or 'fvsolve'}: {error.strerror or error}", 2)
    except MemoryError:
        _leave("out of memory: fewer cells, fewer probes, or a larger [output] every", 1)
    except Exception as error:  # a fault of ours: say where, so that it can be reported
        _leave(f"internal error in {_where(error)}: {type(error).__name__}: {error}; please report it", 1)
    finally:
        warnings.formatwarning = before


def _wanted(command: list[str]) -> tuple[str, ...]:
    """The files that a command line needs: that of its command, or all where it names none."""
    if command and command[0] in PLAIN:
        return COMMANDS[:1]
    return COMMANDS


def _leave(message: str, code: int) -> None:
    print(visible(message), file=sys.stderr)
    sys.exit(code)


def _where(error: Exception) -> str:
    trace = error.__traceback__
    while trace.tb_next is not None:
        trace = trace.tb_next
    return f"{trace.tb_frame.f_code.co_filename}, line {trace.tb_lineno}"
