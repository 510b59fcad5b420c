"""Sinks of other packages that a case names: they receive what the run directory of a run receives.

A sink is a class without arguments. Its object is made for one run, and has these methods:

open(model, folder, kept) : before the run, or before its continuation; folder : path of the run directory
                      kept : number of rows of an earlier part of the run that stay: further rows come again
rows(t, values)     : rows of the history. t : float64[k] [s]; values : float64[k, probes] in SI, in the order of
                      `model.probes`
field(t, frame)     : fields of pipes, basins and bodies at time t [s], optional; frame : part -> quantity -> values
end(summary)        : end of the run, optional; summary : object with `reason`, `extremes` and `warnings`
close()             : after the run, also after a failed run, if `open` succeeded
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from fvsolve.case.sections import SINKS
from fvsolve.core.output.directory import RunDirectory
from fvsolve.declarations import Declaration, unreadable
from fvsolve.errors import FvsolveError, RunError

METHODS = ("open", "rows", "close")  # methods that each sink has


class OtherSink:
    """Sink of another package, whose exceptions become a RunError with its name."""

    def __init__(self, declaration: Declaration):
        self.declaration = declaration
        maker = declaration.load()
        self.opened = False
        try:
            self.sink = maker()
            missing = [name for name in METHODS if not callable(getattr(self.sink, name, None))]
            if missing:
                raise TypeError(
                    f"its object has no method {', '.join(missing)}; expected {', '.join(METHODS)}"
                )
        except Exception as error:
            raise FvsolveError(unreadable(declaration.source, declaration.place, error)) from error

    def call(self, method: str, *arguments: Any) -> None:
        """Call a method, if the sink has it. Raises RunError for any exception of the sink."""
        function: Callable | None = getattr(self.sink, method, None)
        try:
            if function is not None:
                function(*arguments)
        except Exception as error:
            text = f'sink "{self.declaration.name}" ({self.declaration.place}): {method}() failed'
            remedy = "correct the sink, or remove it from output.sinks"
            raise RunError(f"{text}: {type(error).__name__}: {error}; {remedy}") from error


def read_sinks(names: Iterable[str]) -> list[OtherSink]:
    """Sinks with these names, not opened. Raises FvsolveError if a sink cannot be imported, or lacks a method."""
    return [OtherSink(SINKS[name]) for name in names]


class SeveralSinks:
    """Receiver of the output of a run: the run directory, followed by sinks of other packages.

    All other attributes are those of the run directory.
    """

    def __init__(self, directory: RunDirectory, sinks: list[OtherSink]):
        self.directory = directory
        self.sinks = sinks
        self.complete = False  # True after the end of the run

    def __getattr__(self, name: str) -> Any:
        return getattr(self.directory, name)

    def begin(self, model: Any, state: Any) -> None:
        """Open the sinks, then the files: a sink that fails leaves an earlier run as it is."""
        restart = self.directory.restart
        kept = 0 if restart is None else restart.rows
        for sink in self.sinks:
            sink.call("open", model, self.directory.folder, kept)
            sink.opened = True
        self.directory.begin(model, state)

    def rows(self, t: np.ndarray, values: np.ndarray) -> None:
        """Pass rows of probe values on. Each sink gets its own copy, which it may keep or change."""
        self.directory.rows(t, values)
        for sink in self.sinks:
            sink.call("rows", np.array(t), np.array(values))

    def field(self, t: float, frame: dict) -> None:
        """Pass the fields at time t [s] on."""
        self.directory.field(t, frame)
        for sink in self.sinks:
            sink.call("field", t, frame)

    def end(self, summary: Any) -> None:
        """Pass the summary on."""
        self.directory.end(summary)
        for sink in self.sinks:
            sink.call("end", summary)
        self.complete = True

    def close(self) -> None:
        """Close the opened sinks, then the run directory; then raise the first error of a sink.

        After a failed run it raises nothing, so that the message is about the failure.
        """
        errors = []
        for sink in self.sinks:
            try:
                if sink.opened:
                    sink.call("close")
            except RunError as error:
                errors.append(error)
        self.directory.close()
        if errors and self.complete:
            raise errors[0]
