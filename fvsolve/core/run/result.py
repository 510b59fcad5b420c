"""Class `Result` of a run: probes over time, extremes, verdicts, pictures."""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.argument_checks import COUNT_FROM_ZERO, NUMBER, PATH, TEXT, validated
from fvsolve.core.output.fields import read_series
from fvsolve.core.output.summary_shape import (
    Comparison,
    Expectation,
    Extremes,
    LimitVerdict,
    ResultMark,
)
from fvsolve.core.output.unit_columns import UnitColumn
from fvsolve.display import Displayable, save_if_path
from fvsolve.errors import FvsolveError, Notice, RunError, did_you_mean
from fvsolve.parts.date_keys import moment_text, start_time_in
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.case import Case
    from fvsolve.parts.time_stamps import StartTime

KINDS_WITH_FIELDS = frozenset(("pipe", "basin", "body"))  # kinds of parts that frames show


def not_valid(summary: dict) -> str:
    """Text with the time from which the numbers of a diverged run are not valid; "" for other runs."""
    if summary["invalid_from"] is None:
        return ""
    clock = UnitColumn("t", "time", summary["time_unit"])
    begin = summary["invalid_from"]
    text = f"{float(clock.from_si(begin)):.6g} {clock.unit}"
    return f"not valid from t = {moment_text(text, begin, start_time_in(summary))} on"


class Result(Displayable):
    """Result of a run: probes over time and facts about the run, in the units of `[output]`.

    result["gate.pressure"] : float64[rows]  values of a probe in the unit `result.units["gate.pressure"]`
    result.t : float64[rows]  times; result.seconds : times [s]
    result.summary : all facts except the arrays as plain data; result.directory : run directory, or None
    """

    def __init__(
        self,
        summary: dict,
        table: Callable[[], np.ndarray],
        envelope: Callable[[], dict],
        directory: Path | None = None,
        maxima: Callable[[], dict] = dict,
    ):
        self.summary = summary
        self.units = {name: probe["unit"] for name, probe in summary["probes"].items()}
        self.directory = directory
        # rows of every limit (`verdicts.places`); None if read from files
        self.places: list[list[dict]] | None = None
        self._read_table = table
        self._read_envelope, self._read_maxima = envelope, maxima

    @property
    def reason(self) -> str:
        """`finished`, or the reason of an early end."""
        return self.summary["reason"]

    @property
    def ok(self) -> bool:
        """True if the run reached its end, no warning marks its numbers as wrong, and no discharge was held."""
        return self.summary["ok"]

    @property
    def marks(self) -> list[ResultMark]:
        """First part and time from which results are not valid, one mark for each cause."""
        return [ResultMark(**mark) for mark in self.summary["marks"]]

    @property
    def warnings(self) -> list[Notice]:
        """Notices of legal but remarkable situations; if `ok` of a notice is False, `ok` of the run is False."""
        return [Notice(**notice) for notice in self.summary["warnings"]]

    @property
    def ledger(self) -> dict:
        """Balances by name, such as "mass" [kg]: inflow, outflow, storage and remainder."""
        return self.summary["ledgers"]

    @property
    def extremes(self) -> dict[str, Extremes]:
        """Least and greatest value of each probe, with times."""
        return {
            name: Extremes(*(row[key] for key in Extremes._fields))
            for name, row in self.summary["extremes"].items()
        }

    @property
    def expectations(self) -> list[Expectation]:
        """Claims of the case, with their states."""
        return [Expectation(**row) for row in self.summary["expectations"]]

    @property
    def verdicts(self) -> list[LimitVerdict]:
        """Verdicts on the limits of `[limits]`, each with the part and time of the least margin."""
        return [LimitVerdict(**row) for row in self.summary["verdicts"]]

    @property
    def comparisons(self) -> list[Comparison]:
        """Differences of each measured series from its probe."""
        return [Comparison(**row) for row in self.summary["comparisons"]]

    @cached_property
    def case(self) -> "Case":
        """Case of the run, with all defaults filled in; read from the run directory if necessary."""
        from fvsolve.case import load

        return load(self.directory / "case.toml")

    @cached_property
    def envelope(self) -> dict:
        """Pipe -> distance, elevation, initial head, extremes of pressure and head over all steps, times: float64[k].

        The k positions are the cells, and observed points between cells. Values are in the units of `[output]`.
        """
        tables = self._read_envelope()
        for arrays in tables.values():
            for array in arrays.values():
                array.flags.writeable = False
        return tables

    @cached_property
    def maxima(self) -> dict:
        """Basin -> greatest value over all steps, time of arrival or duration of wetting -> float64[cells] in SI."""
        return self._read_maxima()

    @property
    def run_up(self) -> dict:
        """Run-up of `[output]` -> its columns in m and degrees : float64[sectors], NaN where nothing became wet."""
        tables = self.summary.get("run_up", {})
        return {
            name: {
                key: np.array(values, float)
                for key, values in table.items()
                if isinstance(values, list)
            }
            for name, table in tables.items()
        }

    @cached_property
    def routes(self) -> dict:
        """Route -> chainage, pipe, distance, elevation, least and greatest pressure and head, times, along it."""
        from fvsolve.core.output.csv_files import route_envelopes

        return route_envelopes(self.envelope, self.case)

    @property
    def probes(self) -> list[str]:
        """Names of the probes, in the order of the table."""
        return list(self.units)

    @cached_property
    def _table(self) -> np.ndarray:
        table = self._read_table()
        if table.shape[1] != 1 + len(self.units):
            counts = f"number of columns {table.shape[1]}; expected {1 + len(self.units)}, the time and each probe"
            raise RunError(f"history.csv: {counts}; run the case again with --force")
        table.flags.writeable = False
        return table

    @property
    def t(self) -> np.ndarray:
        """Times of the rows, in s or the unit of `[output]`; at a jump two rows have the same time."""
        return self._table[:, 0]

    @property
    def seconds(self) -> np.ndarray:
        """Times of the rows [s]."""
        return self._time.to_si(self.t)

    @property
    def start_time(self) -> "StartTime | None":
        """Instant of t = 0, `[numerics] start_time`; None without one."""
        return start_time_in(self.summary)

    @property
    def times(self) -> np.ndarray:
        """Dates of the rows on the clock of `start_time` : datetime64[us]. Raises FvsolveError without start time."""
        if (start := self.start_time) is None:
            raise FvsolveError(
                "the case has no start time; expected numerics.start_time, for example 2026-03-01T06:00:00Z"
            )
        return start.datetimes(self.seconds)

    @property
    def drawn_times(self) -> np.ndarray:
        """Times of the rows for the axis of a picture: dates with a start time, otherwise as `t`."""
        return self.t if self.start_time is None else self.times

    @property
    def drawn_unit(self) -> str:
        """Unit of `drawn_times` for the label of an axis: the zone of dates, otherwise the unit of times."""
        return self._time.unit if self.start_time is None else self.start_time.zone

    def _drawn_times(self, seconds: Any) -> np.ndarray:
        start = self.start_time
        return self._time.from_si(seconds) if start is None else start.datetimes(seconds)

    @property
    def _time(self) -> UnitColumn:
        return UnitColumn("t", "time", self.summary["time_unit"])

    def __getitem__(self, probe: str) -> np.ndarray:
        return self._table[:, 1 + self.probes.index(self._known(probe))]

    def _known(self, probe: str) -> str:
        if not isinstance(probe, str) or probe not in self.units:
            raise FvsolveError(
                f"no probe {show(probe)}{did_you_mean(str(probe), self.units)}; see Result.probes"
            )
        return probe

    def frame(self) -> Any:
        """Table as a pandas DataFrame, time as index. Raises FvsolveError if pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise FvsolveError("Result.frame() needs pandas: pip install pandas") from None
        index = pandas.Index(self.t.copy(), name=self._time.header)
        headers = [f"{name} [{unit}]" for name, unit in self.units.items()]
        return pandas.DataFrame(self._table[:, 1:].copy(), index=index, columns=headers)

    @validated(path=PATH)
    def plot(self, path: str | Path | None = None) -> Any:
        """Figure (matplotlib) of the probes over time, also written to `path` if given."""
        from fvsolve.report.draw.plot import history_figure

        return save_if_path(history_figure(**self.history_drawn()), path)

    def history_drawn(self) -> dict[str, Any]:
        """Arguments for the function `history_figure`; empty without probes."""
        if not self.probes:
            return {}
        marks = [
            (np.asarray(self._drawn_times(item.time))[()], f"{item.place} {item.what}")
            for item in self.marks
        ]
        times = self.drawn_times
        marks += [
            (times[0], f"{item.place} {item.kind}")
            for item in self.warnings
            if not item.ok and len(times)
        ]
        return {
            "t": times,
            "values": self._table[:, 1:],
            "probes": list(self.units.items()),
            "time_unit": self.drawn_unit,
            "marks": marks,
            "measured": self._measured(),
            "title": self.summary["title"],
        }

    @validated(path=PATH)
    def plot_envelope(self, path: str | Path | None = None) -> Any:
        """Figure (matplotlib) of least and greatest head along the pipes, also written to `path` if given."""
        from fvsolve.report.draw.plot import envelope_figure

        return save_if_path(envelope_figure(**self.envelope_drawn()), path)

    def envelope_drawn(self) -> dict[str, Any]:
        """Arguments for the function `envelope_figure`; empty without pipes."""
        if not self.envelope:
            return {}
        return {
            "envelope": self.envelope,
            "units": self.summary["envelope_units"],
            "title": self.summary["title"],
        }

    @validated(name=TEXT, path=PATH)
    def plot_run_up(self, name: str, path: str | Path | None = None) -> Any:
        """Figure (matplotlib) of a run-up over angle or distance, also written to `path` if given."""
        from fvsolve.report.draw.plot import run_up_figure

        if name not in self.run_up:
            raise FvsolveError(
                f"no run-up {show(name)}{did_you_mean(name, self.run_up)}; see Result.run_up"
            )
        return save_if_path(run_up_figure(**self.run_up_drawn(name)), path)

    def run_up_drawn(self, name: str) -> dict[str, Any]:
        """Arguments for the function `run_up_figure`; name : name of the run-up"""
        return {"columns": self.run_up[name], "name": name, "title": self.summary["title"]}

    @validated(time=NUMBER, field=TEXT, path=PATH, contours=COUNT_FROM_ZERO)
    def view(
        self,
        time: float | None = None,
        field: str | None = None,
        path: str | Path | None = None,
        contours: int = 0,
    ) -> Path:
        """Draw the quantity `field` at the frame nearest to `time` [s] (default: last); return the path of the picture.

        Matplotlib draws cases without basins and bodies, PyVista draws the others.
        path : default: `view-FIELD.png` in the run directory
        By default `field` is pressure, or without pipes the first field of the first basin, or without basins the
        speed of bodies; without all of these only the parts are drawn. `contours` : number of contour lines. Raises
        RunError without frames, FvsolveError if drawing is not possible.
        """
        if field is None and self.directory is not None and not self._kinds & KINDS_WITH_FIELDS:
            return self._draw([], "parts", path, ".png", 0)
        times = [t for t, _ in self._frames()]
        t = times[-1] if time is None else min(times, key=lambda frame_time: abs(frame_time - time))
        return self._draw([t], field, path, ".png", contours)

    @validated(path=PATH, field=TEXT, contours=COUNT_FROM_ZERO)
    def animate(
        self, path: str | Path | None = None, field: str | None = None, contours: int = 0
    ) -> Path:
        """Draw all frames as `view` does into an animation, a .gif or .mp4 file; return the path."""
        return self._draw(
            list(dict.fromkeys(t for t, _ in self._frames())), field, path, ".gif", contours
        )

    @property
    def _kinds(self) -> set[str]:
        """Kinds of the parts of the case."""
        return {part.kind for part in (*self.case.nodes.values(), *self.case.links.values())}

    def _frames(self) -> list[tuple[float, Path]]:
        if self.directory is None or not (self.directory / "fields.pvd").is_file():
            raise RunError(f"no frames to draw: {self._no_frames()}")
        frames = read_series(self.directory / "fields.pvd")
        if not frames:
            raise RunError(f"{self.directory / 'fields.pvd'} lists no frames")
        return frames

    def _no_frames(self) -> str:
        """Text of the reason for which a run has no frames."""
        if self.directory is None:
            return "nothing was written; run again with a run directory (`out`)"
        if not self._kinds & KINDS_WITH_FIELDS:
            return "the case has no basin, body or pipe"
        if self.case.output.fields == 0:
            return "[output] fields is 0; run again with --set output.fields=20 --force"
        return f"{self.directory / 'fields.pvd'} is missing; run again with --force"

    def _draw(
        self, times: list[float], field: str | None, path, suffix: str, contours: int
    ) -> Path:
        from fvsolve.core.run.plot_scene import scene_of
        from fvsolve.report.draw.view import view

        if field is None:
            pipes = any(link.kind == "pipe" for link in self.case.links.values())
            basins = [self.case.nodes[name] for name in self.case.meshes]
            bodies = any(node.kind == "body" for node in self.case.nodes.values())
            field = (
                "pressure"
                if pipes or not basins
                else next(iter(basins[0].physics_type.fields), "pressure")
            )
            field = "speed" if bodies and not pipes and not basins else field
        out = Path(path) if path else self.directory / f"view-{field}{suffix}"
        frames = self._frames() if times else []
        drawn = [(t, [file for at, file in frames if at == t]) for t in times]
        view(scene_of(self.case, self.summary["title"], field, drawn, contours), out)
        return out

    def _measured(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        compared = self.case.compare if self.comparisons else {}
        measured = {}
        for series in compared.values():
            name = series.probe.text
            measured[name] = (
                self._drawn_times(series.t + series.shift),
                self.column(name).from_si(series.v),
            )
        return measured

    def column(self, probe: str) -> UnitColumn:
        """Name, dimension and unit of a probe, with conversions to and from SI.

        Raises FvsolveError for an unknown probe.
        """
        return UnitColumn(
            self._known(probe),
            **self.summary["probes"][probe],
            ambient=self.summary["ambient_pressure"],
        )

    def si(self, probe: str) -> np.ndarray:
        """Values of a probe in SI, pressures absolute: float64[rows]."""
        return self.column(probe).to_si(self[probe])

    def summary_line(self) -> str:
        summary = self.summary
        return (
            f"{summary['case']!r}: {self.reason}, t = {summary['t']:g} s, {len(self.units)} probes"
        )

    def table_columns(self) -> dict[str, list]:
        """Columns of a table of the probes: name, unit, least and greatest value, and their times."""
        columns = {"probe": self.probes, "unit": list(self.units.values())}
        return columns | {
            key: [getattr(row, key) for row in self.extremes.values()] for key in Extremes._fields
        }
