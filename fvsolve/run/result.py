"""What a run has to show: probes over time, extremes, claims. Knows arrays and words; starts no run."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve.doors import AMOUNT, NUMBER, PATH, TEXT, door
from fvsolve.errors import FvsolveError, Notice, RunError, did_you_mean, listing
from fvsolve.output.column import UnitColumn
from fvsolve.output.fields import read_series
from fvsolve.shown import Shown, kept
from fvsolve.units import show

FIELDED = frozenset(("pipe", "basin", "body"))  # kinds of parts that frames show

HOLDS, OPEN, FAILS = "holds", "open", "fails"  # states of a limit
IN_WORDS = {HOLDS: "holds", OPEN: "open", FAILS: "FAILS"}


def not_valid(said: dict) -> str:
    """From when on the numbers of a run that blew up are no results, by its summary; "" of another."""
    if said["invalid_from"] is None:
        return ""
    clock = UnitColumn("t", "time", said["time_unit"])
    return f"not valid from t = {float(clock.from_si(said['invalid_from'])):.6g} {clock.unit} on"


class ResultMark(NamedTuple):
    """First place and time [s] of what the model cannot follow: do not trust results from there on."""

    what: str
    place: str
    time: float
    text: str


class Extremes(NamedTuple):
    """Least and greatest over all accepted steps and rows, in the unit of the probe, and when [s].

    None of what a run that blew up came to where it is not valid.
    """

    least: float
    t_least: float
    greatest: float
    t_greatest: float


class Expectation(NamedTuple):
    """A claim of the case; `claimed`, `found`, `tolerance` and `error` in `unit`.

    state : `holds`, `fails`, or `open` where the run cannot tell; ok : whether it holds
    error : how far `found` may be off, None where nobody asked
    """

    text: str
    claimed: float
    found: float | None
    tolerance: float
    unit: str
    state: str
    ok: bool
    error: float | None


class LimitVerdict(NamedTuple):
    """A limit of the case, and the place that decides it; lengths in m, times in s, else `unit`.

    state : `holds`; `fails` where it is passed; `open` where a run cannot tell, or the error of a place is more than
    its margin; ok : whether it holds; margin : how far from the limit, negative beyond it
    bound : "least" or "greatest"; until : when the run ended
    error : how far `value` may be off, None where nobody asked; reason : why it is wide or not known
    worst : the same of the worst places, a row for each bound of each part
    """

    name: str
    ok: bool
    state: str
    place: str
    chainage: float | None
    elevation: float | None
    time: float | None
    bound: str
    value: float | None
    limit: float | None
    margin: float | None
    unit: str
    quantity: str
    until: float
    error: float | None
    reason: str | None
    worst: list[dict]

    @property
    def doubtful(self) -> bool:
        """True if it is not passed, but its value may be off by more than its margin."""
        return self.state == OPEN and None not in (self.error, self.margin) and self.margin < self.error


class Comparison(NamedTuple):
    """A measured series held against its probe: differences and peaks in `unit`, times in s."""

    probe: str
    unit: str
    file: str
    shift: float
    points: int
    rms: float | None
    greatest_difference: float | None
    t_greatest_difference: float | None
    measured_peak: float | None
    t_measured_peak: float | None
    computed_peak: float | None
    t_computed_peak: float | None


class Result(Shown):
    """Probes over time and what is to be said about them, in the units of `[output]`.

    `result.t` [s], `result["gate.pressure"]` float64[rows] in `result.units["gate.pressure"]`, `.probes`,
    `.reason`, `.ok`, `.marks`, `.warnings`, `.ledger`, `.extremes`, `.envelope`, `.routes`, `.expectations`,
    `.verdicts`, `.comparisons`; all but the arrays as plain data in `result.summary`. `result.directory` is where it is
    on disk, or None.
    """

    def __init__(
        self,
        summary: dict,
        table: Callable[[], np.ndarray],
        envelope: Callable[[], dict],
        directory: Path | None = None,
    ):
        self.summary = summary
        self.units = {name: probe["unit"] for name, probe in summary["probes"].items()}
        self.directory = directory
        self.places: list[list[dict]] | None = None  # rows of every limit (`verdicts.places`); None if read back
        self._read_table = table
        self._read_envelope = envelope

    @property
    def reason(self) -> str:
        """`finished`, or why the run ended before its end."""
        return self.summary["reason"]

    @property
    def ok(self) -> bool:
        """True if the run came to its end, and no warning says that its numbers are wrong."""
        return self.summary["ok"]

    @property
    def marks(self) -> list[ResultMark]:
        """First place and time from which results are not to be trusted, one per cause."""
        return [ResultMark(**one) for one in self.summary["marks"]]

    @property
    def warnings(self) -> list[Notice]:
        """What is legal but to be known; one whose `ok` is False makes the run's False."""
        return [Notice(**one) for one in self.summary["warnings"]]

    @property
    def ledger(self) -> dict:
        """What came in, went out and is stored, and the remainder, per ledger (`mass` [kg])."""
        return self.summary["ledgers"]

    @property
    def extremes(self) -> dict[str, Extremes]:
        """Least and greatest of each probe, and when."""
        return {
            name: Extremes(*(one[key] for key in Extremes._fields)) for name, one in self.summary["extremes"].items()
        }

    @property
    def expectations(self) -> list[Expectation]:
        """What the case claims, and whether it holds."""
        return [Expectation(**one) for one in self.summary["expectations"]]

    @property
    def verdicts(self) -> list[LimitVerdict]:
        """What `[limits]` ask for, whether it holds, and where and when it is nearest to failing."""
        return [LimitVerdict(**one) for one in self.summary["verdicts"]]

    @property
    def comparisons(self) -> list[Comparison]:
        """How far each measured series is from its probe."""
        return [Comparison(**one) for one in self.summary["comparisons"]]

    @cached_property
    def case(self):
        """The case as resolved, read back from the run directory where it is not at hand."""
        from fvsolve.case import load

        return load(self.directory / "case.toml")

    @cached_property
    def envelope(self) -> dict:
        """Pipe -> distance, elevation, least and greatest pressure and head, times: float64[cells]."""
        found = self._read_envelope()
        for arrays in found.values():
            for array in arrays.values():
                array.flags.writeable = False
        return found

    @cached_property
    def routes(self) -> dict:
        """Route -> chainage, pipe, distance, elevation, least and greatest pressure and head, times, along it."""
        from fvsolve.output.routes import along_routes

        return along_routes(self.envelope, self.case)

    @property
    def probes(self) -> list[str]:
        """Names of the probes, in the order of the table."""
        return list(self.units)

    @cached_property
    def _table(self) -> np.ndarray:
        table = self._read_table()
        if table.shape[1] != 1 + len(self.units):
            raise RunError(f"history.csv has {table.shape[1]} columns; wanted the time and {len(self.units)} probes")
        table.flags.writeable = False
        return table

    @property
    def t(self) -> np.ndarray:
        """Times of the rows, in s unless `[output]` says otherwise; at a jump two rows have the same time."""
        return self._table[:, 0]

    @property
    def seconds(self) -> np.ndarray:
        """Times of the rows [s]."""
        return self._time.to_si(self.t)

    @property
    def _time(self) -> UnitColumn:
        return UnitColumn("t", "time", self.summary["time_unit"])

    def __getitem__(self, probe: str) -> np.ndarray:
        return self._table[:, 1 + self.probes.index(self._known(probe))]

    def _known(self, probe: str) -> str:
        if not isinstance(probe, str) or probe not in self.units:
            raise FvsolveError(f"no probe {show(probe)}{did_you_mean(str(probe), self.units)}; see Result.probes")
        return probe

    def frame(self):
        """The table as a pandas DataFrame, time as index; FvsolveError where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise FvsolveError("Result.frame() needs pandas: pip install pandas") from None
        index = pandas.Index(self.t.copy(), name=self._time.header)
        headers = [f"{name} [{unit}]" for name, unit in self.units.items()]
        return pandas.DataFrame(self._table[:, 1:].copy(), index=index, columns=headers)

    @door(path=PATH)
    def plot(self, path=None):
        """The probes over time as a matplotlib Figure, also written to `path` where one is given."""
        from fvsolve.draw.plot import history_figure

        return kept(history_figure(**self.history_drawn()), path)

    def history_drawn(self) -> dict[str, Any]:
        """What the picture of the history shows, nothing where no probe was asked for."""
        if not self.probes:
            return {}
        marks = [(self._time.from_si(one.time), f"{one.place} {one.what}") for one in self.marks]
        marks += [(self.t[0], f"{one.place} {one.kind}") for one in self.warnings if not one.ok and len(self.t)]
        return {
            "t": self.t, "values": self._table[:, 1:], "probes": list(self.units.items()),
            "time_unit": self._time.unit, "marks": marks, "measured": self._measured(), "title": self.summary["title"],
        }  # fmt: skip

    @door(path=PATH)
    def plot_envelope(self, path=None):
        """Least and greatest head along the pipes as a matplotlib Figure, also written to `path`."""
        from fvsolve.draw.plot import envelope_figure

        return kept(envelope_figure(**self.envelope_drawn()), path)

    def envelope_drawn(self) -> dict[str, Any]:
        """What the picture of the envelope shows, nothing where there are no pipes."""
        if not self.envelope:
            return {}
        return {
            "envelope": self.envelope, "units": self.summary["envelope_units"], "title": self.summary["title"],
        }  # fmt: skip

    @door(time=NUMBER, field=TEXT, path=PATH, contours=AMOUNT)
    def view(self, time: float | None = None, field: str | None = None, path=None, contours: int = 0) -> Path:
        """Draw `field` at the frame nearest to `time` [s] (the last by default) with PyVista; its path.

        Left out, `field` is pressure, or where there are no pipes the first of the first basin, and of a case without
        pipes, basins and bodies its parts alone; `contours` are lines of equal values. RunError where there are no
        frames, FvsolveError where nothing can be drawn.
        """
        if field is None and self._lumped:
            return self._draw([], "parts", path, ".png", 0)
        times = [t for t, _ in self._frames()]
        t = times[-1] if time is None else min(times, key=lambda one: abs(one - time))
        return self._draw([t], field, path, ".png", contours)

    @door(path=PATH, field=TEXT, contours=AMOUNT)
    def animate(self, path=None, field: str | None = None, contours: int = 0) -> Path:
        """Draw all frames as `view` does, as a .gif or .mp4; its path."""
        return self._draw(list(dict.fromkeys(t for t, _ in self._frames())), field, path, ".gif", contours)

    @property
    def _lumped(self) -> bool:
        """Whether there is nothing that has fields."""
        kinds = {part.kind for part in (*self.case.nodes.values(), *self.case.links.values())}
        return self.directory is not None and not kinds & FIELDED

    def _frames(self) -> list[tuple[float, Path]]:
        if self.directory is None or not (self.directory / "fields.pvd").is_file():
            raise RunError(f"no frames to draw: {self._no_frames()}")
        frames = read_series(self.directory / "fields.pvd")
        if not frames:
            raise RunError(f"{self.directory / 'fields.pvd'} lists no frames")
        return frames

    def _no_frames(self) -> str:
        """The reason why a run has no frames."""
        if self.directory is None:
            return "nothing was written; give the run a directory"
        if not {part.kind for part in (*self.case.nodes.values(), *self.case.links.values())} & FIELDED:
            return f"the case has none of {listing(sorted(FIELDED))}"
        if self.case.output.fields == 0:
            return "[output] fields is 0; run again with --set output.fields=20"
        return f"{self.directory / 'fields.pvd'} is missing; run again with --force"

    def _draw(self, times: list[float], field: str | None, path, suffix: str, contours: int) -> Path:
        from fvsolve.draw.view import view
        from fvsolve.run.drawn import scene_of

        if field is None:
            pipes = any(link.kind == "pipe" for link in self.case.links.values())
            basins = [self.case.nodes[name] for name in self.case.meshes]
            bodies = any(node.kind == "body" for node in self.case.nodes.values())
            field = "pressure" if pipes or not basins else next(iter(basins[0].own.fields), "pressure")
            field = "speed" if bodies and not pipes and not basins else field
        out = Path(path) if path else self.directory / f"view-{field}{suffix}"
        frames = self._frames() if times else []
        found = [(t, [file for at, file in frames if at == t]) for t in times]
        view(scene_of(self.case, self.summary["title"], field, found, contours), out)
        return out

    def _measured(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        compared = self.case.compare if self.comparisons else {}
        return {
            one.probe.text: (
                self._time.from_si(one.t + one.shift),
                self.column(one.probe.text).from_si(one.v),
            )
            for one in compared.values()
        }

    def column(self, probe: str) -> UnitColumn:
        """Name, dimension and unit of a probe, with the way to and from SI."""
        return UnitColumn(self._known(probe), **self.summary["probes"][probe], ambient=self.summary["ambient_pressure"])

    def si(self, probe: str) -> np.ndarray:
        """One probe in SI, pressures absolute: float64[rows]."""
        return self.column(probe).to_si(self[probe])

    def said(self) -> str:
        said = self.summary
        return f"{said['case']!r}: {self.reason}, t = {said['t']:g} s, {len(self.units)} probes"

    def listed(self) -> dict[str, list]:
        """Of every probe: unit, least and greatest with their times."""
        found = {"probe": self.probes, "unit": list(self.units.values())}
        return found | {key: [getattr(one, key) for one in self.extremes.values()] for key in Extremes._fields}
