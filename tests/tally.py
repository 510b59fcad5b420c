"""Count of parts, schemes, methods, commands and shipped cases that the tests of a session ran."""

import functools
from collections import defaultdict
from pathlib import Path

from reference import folders


class Tally:
    """Names that were run, by kind, from hooks in this process and from workers of pytest-xdist."""

    def __init__(self) -> None:
        self.names: dict[str, set[str]] = defaultdict(set)

    def start(self) -> None:
        """Record each run, each stepper and each command of this process."""
        from fvsolve import cli
        from fvsolve.core.solve.solve import Run
        from fvsolve.core.steppers.integrator import Integrator

        Run.go = self._after(Run.go, self._run)
        Integrator.__init__ = self._after(
            Integrator.__init__, lambda stepper, method, *_: self._add("method", method.name)
        )
        cli.application = self._after(
            cli.application, lambda *command: self._add("command", *command)
        )

    def add(self, plain: dict[str, list[str]]) -> None:
        for kind, names in plain.items():
            self.names[kind].update(names)

    def plain(self) -> dict[str, list[str]]:
        return {kind: sorted(names) for kind, names in self.names.items()}

    def missing(self) -> list[str]:
        """Lines for each kind with a name that was not run, and for each listed test that does not exist."""
        lines = {kind: sorted(names - self.names[kind]) for kind, names in expected().items()}
        unknown = [
            f"tests/durations.json: {name} is not a test" for name in sorted(self.names["unknown"])
        ]
        return [f"{kind}: {', '.join(names)}" for kind, names in lines.items() if names] + unknown

    def _add(self, kind: str, *names: str) -> None:
        self.names[kind].update(names)

    def _run(self, run) -> None:
        case = run.model.case
        self._add("part", *(part.kind for part in (*case.nodes.values(), *case.links.values())))
        self._add("scheme", case.numerics.scheme)
        self._add("law", case.fluid.law)
        if case.path is not None and case.path.resolve().parent == folders.CASES.resolve():
            self._add("shipped case", case.path.stem)

    def _after(self, function, record):
        @functools.wraps(function)
        def recorded(*args, **kwargs):
            result = function(*args, **kwargs)
            record(*args)
            return result

        return recorded


def parts() -> dict[str, type]:
    from fvsolve.parts import KINDS

    return {name: part for kinds in KINDS.values() for name, part in kinds.items()}


def unknown_names(listed, collected: list[str]) -> set[str]:
    """Listed tests that do not exist: those of collected files, and of files that are gone.

    A file of which no test is collected needs an optional library that is missing.
    """
    files = {name.partition("::")[0] for name in collected}
    places = {name: name.partition("::")[0] for name in {*listed} - {*collected}}
    return {
        name
        for name, file in places.items()
        if file in files or not (Path(__file__).parents[1] / file).is_file()
    }


def expected() -> dict[str, set[str]]:
    """Every part, scheme, method, law, command and shipped case, by kind."""
    from fvsolve import cli
    from fvsolve.core.fluid.laws import LAWS
    from fvsolve.core.schemes import SCHEMES
    from fvsolve.core.steppers.tableau import METHODS

    return {
        "part": set(parts()),
        "scheme": set(SCHEMES),
        "method": {method.name for method in METHODS.values()},
        "law": set(LAWS),
        "command": {
            command.name or command.callback.__name__
            for command in cli.application().registered_commands
        },
        "shipped case": {path.stem for path in folders.CASES.glob("*.toml")},
    }
