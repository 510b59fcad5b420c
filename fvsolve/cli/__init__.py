"""Command line interface; the only package that prints or exits; may import all, and none imports it."""

import atexit
import copy
import errno
import gc
import os
import re
import sys
import warnings

from fvsolve.cli.streams import safe_streams
from fvsolve.declarations import Declaration, Declarations
from fvsolve.errors import FvsolveError, visible

__all__ = ["main"]

# A command is a function with the header `@command("NAME", order=N)`; its help text is its docstring.
HEADER = re.compile(
    r'\n@(?:cli\.)?command\(\s*"(?P<name>[\w-]+)"(?:,\s*order=(?P<order>\d+))?,?\s*\)'
    r"\ndef (?P<attribute>\w+)\("
    r'(?:.*\n(?:(?:    |\)).*\n)*?    """(?P<help>[\s\S]*?)""")?'
)
COMMANDS = Declarations("command", "commands", ("cli/*.py",), HEADER)


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
            # a reader may leave early
            if exit.code or output.error is None or output.error.errno == errno.EPIPE:
                raise
            _exit_with(f"standard output: cannot be written: {output.error.strerror}", 2)


def run_command() -> None:
    """Run the command of `sys.argv`, and exit with its code."""
    if sys.argv[1:] == ["--version"]:  # without the imports of any command
        import fvsolve

        print(f"fvsolve {fvsolve.__version__}")
        sys.exit(0)
    # at the end Python would search all modules for unused objects, a fifth of a short run
    atexit.register(gc.freeze)
    # more threads of linear algebra cost time for these matrices
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # else pydantic searches all installed packages
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if sys.argv[1:2] == ["run"]:
        gc.disable()  # until `run` has imported its modules, none of which becomes unused
    before, warnings.formatwarning = (
        warnings.formatwarning,
        lambda message, *_, **__: f"{visible(str(message))}\n",
    )
    try:
        (overview() if sys.argv[1:] in ([], ["--help"]) else application(*sys.argv[1:2]))(
            prog_name="fvsolve"
        )
    except FvsolveError as error:
        _exit_with(str(error), 2)
    except KeyboardInterrupt:
        _exit_with("interrupted", 130)
    except OSError as error:
        _exit_with(f"{error.filename or 'fvsolve'}: {error.strerror or error}", 2)
    except MemoryError:
        _exit_with(
            "out of memory; try fewer cells, fewer probes, or a longer output interval ([output] every)",
            1,
        )
    except Exception as error:
        _exit_with(defect_text(error), 1)
    finally:
        gc.enable()
        os.environ.pop("PYDANTIC_DISABLE_PLUGINS", None)
        warnings.formatwarning = before


def defect_text(error: Exception) -> str:
    """Text about an unexpected error, with its location, so that it can be reported to those who can correct it."""
    from fvsolve.cli.outside_faults import outside_fault

    command = COMMANDS.get(sys.argv[1]) if len(sys.argv) > 1 else None
    source = f"{command.source}: " if command and command.source else ""
    if not source and (text := outside_fault(error)):
        return text
    trace = error.__traceback__
    while trace.tb_next is not None:
        trace = trace.tb_next
    location = f"{trace.tb_frame.f_code.co_filename}, line {trace.tb_lineno}"
    reader = " to its authors" if source else ""
    return f"{source}internal error in {location}: {type(error).__name__}: {error}; please report it{reader}"


def application(command: str = ""):
    """Typer application with the commands of the module of `command`, or with all commands for any other text.

    Raises FvsolveError if `command` is of another package that cannot be imported; of all commands, warns of these.
    """
    from fvsolve.cli.app import add_command, app

    if command in COMMANDS:
        add_command(COMMANDS[command])
        return app
    names = [*COMMANDS]
    for name in names:
        try:
            add_command(COMMANDS[name])
        except FvsolveError as error:
            warnings.warn(str(error), RuntimeWarning, stacklevel=2)
    app.registered_commands.sort(key=lambda info: names.index(info.name))
    return app


def overview():
    """Typer application that only prints its help: all commands, read from the sources without importing them."""
    from fvsolve.cli.app import app

    result = copy.copy(app)
    result.registered_commands = []
    for name, found in COMMANDS.items():
        result.command(name, help=found.options.get("help") or help_text(found))(lambda: None)
    return result


def help_text(command: Declaration) -> str:
    """Docstring of a function, from the text of its module; "" if it has none."""
    import ast

    try:
        statements = ast.parse(command.text()).body
    except (SyntaxError, ValueError):
        return ""
    functions = [
        part
        for part in statements
        if isinstance(part, ast.FunctionDef) and part.name == command.attribute
    ]
    return (ast.get_docstring(functions[-1]) or "") if functions else ""


def _exit_with(message: str, code: int) -> None:
    print(visible(message), file=sys.stderr)
    sys.exit(code)
