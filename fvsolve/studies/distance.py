"""How far a run is from the truth: end fields, rows, extremes; in SI or in ranges. Knows fields, rows; runs nothing.

Every probe has its own range in the truth, every pipe that of its pressure, so that an error of 0.01 is a hundredth of
what that component does there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fvsolve.studies.accuracy.cells import pipes
from fvsolve.studies.accuracy.plane import contents, variable_of
from fvsolve.studies.outcome import Outcome

END = {"nodes": "nodes at the end: ", "links": "links at the end: "}  # before quantities
NORMS = ("L1", "L2", "max")
STILL = 1e-9  # a component that moves by less of its size than this says nothing


@dataclass(frozen=True)
class Gap:
    """How far one component is off.

    off : float64[k]  run less truth [SI]; weights : float64[k]  lengths, areas or times that each counts for
    span : its range in the truth [SI], nan where it stands still
    """

    off: np.ndarray
    weights: np.ndarray
    span: float = math.nan

    def norms(self) -> dict[str, float]:
        """Weighted mean, root mean square and greatest of absolute differences [SI]."""
        size, share = np.abs(self.off), self.weights / self.weights.sum()
        return {"L1": float(share @ size), "L2": math.sqrt(float(share @ size**2)), "max": float(size.max(initial=0.0))}

    def ranges(self) -> dict[str, float]:
        """The same over the range."""
        return {norm: one / self.span for norm, one in self.norms().items()}


@dataclass(frozen=True)
class Distance:
    """Error over the trajectory (mean over time), its greatest value at any row, and at the end; nan: not known.

    All in ranges, of the worst component. overshoot : by how much a probe leaves the range that it has in the truth
    worst : the component whose trajectory error is the greatest
    """

    trajectory: float = math.nan
    greatest: float = math.nan
    end: float = math.nan
    overshoot: float = math.nan
    worst: str = ""


# what runs are asked for --------------------------------------------------------------------------------------------


def recorded(case, keys: Mapping | None = None) -> dict:
    """Keys with which a run of a case also records the end of all nodes and links; no frames."""
    own = [probe.text for probe in case.probes]
    return {**(keys or {}), "output.probes": list(dict.fromkeys([*own, *end_probes(case)])), "output.fields": 0}


def end_probes(case) -> list[str]:
    """What nodes without a given pressure, and links without cells, show."""
    found = []
    for name, node in case.nodes.items():
        shown = [key for key in ("pressure", "level", "position", "velocity") if key in node.quantities]
        if node.kind not in ("reservoir", "frame"):
            found += [f"nodes.{name}.{key}" for key in shown]
    for name, link in case.links.items():
        if "flow" in link.quantities and name not in pipes(case):
            found.append(f"links.{name}.flow")
    return found


# measures -----------------------------------------------------------------------------------------------------------


def differences(run: Outcome, truth, own: tuple[str, ...] | None = None) -> dict[str, dict[str, float]]:
    """Variable -> errors of a run in L1, L2 and max: end fields, probes over time, ends of nodes and links [SI].

    own : probes that are compared over time, all if left out; `recorded` adds further ones for the ends.
    """
    found, parts = {}, field_gaps(run, truth)
    for quantity in ("pressure", "flow") if run.model.pipes else ():
        gaps = [parts[pipe.name, quantity] for pipe in run.model.pipes]
        found[quantity] = Gap(*(np.concatenate([getattr(one, key) for one in gaps]) for key in ("off", "weights")))
    for basin in run.model.basins:
        known = {what: parts.get((basin, what)) for what in contents(basin, run.y)}
        found |= {variable_of(basin, what): gap for what, gap in known.items() if gap is not None}
    ends, last = set(end_probes(run.model.case)), {}
    for name, gap in row_gaps(run, truth).items():
        if name in ends:
            last.setdefault(END[name.split(".")[0]] + name.rsplit(".", 1)[1], []).append(gap.off[-1])
        if own is None or name in own:
            found[name] = gap
    found |= {name: Gap(np.array(off), np.ones(len(off))) for name, off in last.items()}
    return {name: gap.norms() for name, gap in found.items()}


def distance(run: Outcome, truth) -> Distance:
    """Errors of a run in ranges; all nan where it did not reach the end."""
    if not run.ok:
        return Distance()
    with np.errstate(invalid="ignore", over="ignore"):
        ends = [gap.ranges()["L1"] for gap in field_gaps(run, truth).values() if gap.span > 0.0]
        gaps = moving(run, truth)
        if not gaps:
            return Distance(end=max(ends, default=math.nan))
        means = {name: gap.ranges()["L1"] for name, gap in gaps.items()}
        ends += [abs(float(gap.off[-1])) / gap.span for gap in gaps.values()]
        greatest = max(gap.ranges()["max"] for gap in gaps.values())
        beyond = max(max(high, -low) for low, high in extremes(run, truth))
        worst = max(means, key=means.get)
        return Distance(means[worst], greatest, max(ends), max(0.0, beyond), worst)


def extremes_apart(run: Outcome, truth) -> float:
    """How far least and greatest values of probes differ, in ranges; nan where none moves."""
    return max((max(abs(low), abs(high)) for low, high in extremes(run, truth)), default=math.nan)


def extremes(run: Outcome, truth) -> list[tuple[float, float]]:
    """By how much the least and the greatest value of probes that move lie above those of the truth, in ranges."""
    mine, theirs = run.rows[:, 1:], truth.rows(run)
    span = ranges(theirs)
    low, high = ((pick(mine, axis=0) - pick(theirs, axis=0)) / span for pick in (np.min, np.max))
    return [(float(low[k]), float(high[k])) for k in np.flatnonzero(span > 0.0)]


# components ---------------------------------------------------------------------------------------------------------


def moving(run: Outcome, truth) -> dict[str, Gap]:
    """Of the probes that move in the truth."""
    return {name: gap for name, gap in row_gaps(run, truth).items() if gap.span > 0.0}


def row_gaps(run: Outcome, truth) -> dict[str, Gap]:
    """Probe -> how far it is off over time, of those that the truth knows."""
    share, theirs = times(run.rows[:, 0]), truth.rows(run)
    off, span = run.rows[:, 1:] - theirs, ranges(theirs)
    known = [k for k in range(len(run.probes)) if not np.isnan(theirs[:, k]).all()]
    return {run.probes[k]: Gap(off[:, k], share, float(span[k])) for k in known}


def field_gaps(run: Outcome, truth) -> dict[tuple, Gap]:
    """(pipe or basin, quantity) -> how far it is off over the cells at the end.

    Both quantities of a pipe go by the range of its pressure, a flow by that times A / (rho a); what cells of basins
    hold by its own range there, flows along x and y by the greater one.
    """
    model, found = run.model, {}
    theirs = truth.fields(model) if model.pipes or model.basins else {}
    mine = fields(model, waves(run)) if model.pipes else {}
    for k, pipe in enumerate(model.pipes):
        lengths, span = np.full(pipe.cells, pipe.length / pipe.cells), truth.spans.get(pipe.name, math.nan)
        per = float(model.tables.pipes[k]["admittance"]) / model.case.properties.density
        for quantity, one, other, width in zip(("pressure", "flow"), mine[pipe.name], theirs[pipe.name],
                                               (span, span * per), strict=True):  # fmt: skip
            found[pipe.name, quantity] = Gap(one - other, lengths, width)
    for basin in model.basins:
        known = theirs.get(("basin", basin.name))
        if known is None:
            continue
        spans = np.ptp(known, axis=1)
        if len(spans) >= 3 and basin.quantities:
            spans[1:3] = spans[1:3].max()
        for (what, one), other, span in zip(contents(basin, run.y).items(), known, spans, strict=True):
            found[basin, what] = Gap(one - other, basin.mesh.area, float(span) if span > STILL else math.nan)
    return found


def times(t: np.ndarray) -> np.ndarray:
    """What each row counts for in a mean over time [s]; those before and after a jump share one and count half."""
    steps = 0.5 * np.diff(t)
    found = np.append(steps, 0.0) + np.append(0.0, steps)
    return found if found.sum() > 0.0 else np.ones(t.size)


def ranges(values: np.ndarray) -> np.ndarray:
    """Range of every column : float64[columns], nan for those that stand still."""
    span, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
    return np.where(span > STILL * size, span, np.nan)


def spans_of(envelope: Mapping[str, Mapping]) -> dict[str, float]:
    """Pipe -> range of its pressure over a run [Pa], of its envelope."""
    met = {name: np.append(one["least_pressure"], one["greatest_pressure"]) for name, one in envelope.items()}
    return {name: float(ranges(one)) for name, one in met.items()}


# fields -------------------------------------------------------------------------------------------------------------


def fields(model, waves: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict:
    """{pipe: (pressure [Pa], flow [m3/s])} of sums and differences of both waves, averaged over a model's cells."""
    found = {}
    for k, pipe in enumerate(model.pipes):
        total, mass_flow = waves[pipe.name]
        pressure = model.cell_pressure(k, total)
        found[pipe.name] = pressure, (model.tables.pipes[k]["flow"] + mass_flow) / model.case.law.density(pressure)
    return found


def waves(run: Outcome) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Sum and difference of both waves in the cells of every pipe at the end [kg/s]."""
    found = dict(run.lines)
    for row, pipe in zip(run.model.tables.pipes, run.model.pipes, strict=True):
        if pipe.name not in found:
            o, n = int(row["y"]), pipe.cells
            r, l = run.y[o : o + n], run.y[o + n : o + 2 * n]  # noqa: E741
            found[pipe.name] = r + l, r - l
    return found


def averaged(fine: np.ndarray, cells: int) -> np.ndarray:
    """Averages over fewer or more equal cells; what the cells hold together stays the same to the last bit or so."""
    n = fine.size
    if n % cells == 0:
        return fine.reshape(cells, n // cells).mean(axis=1)
    from scipy.interpolate import make_interp_spline

    held = np.concatenate([[0.0], np.cumsum(fine)]) / n
    curve = make_interp_spline(np.linspace(0.0, 1.0, n + 1), held, k=min(5, n))
    return np.diff(curve(np.linspace(0.0, 1.0, cells + 1))) * cells


def size_of(run: Outcome, name: str) -> float:
    """How large a variable of a run is."""
    if name in ("pressure", "flow"):
        k = ("pressure", "flow").index(name)
        return max(float(np.max(np.abs(pair[k]))) for pair in fields(run.model, waves(run)).values())
    for basin in run.model.basins:
        for what, one in contents(basin, run.y).items():
            if name == variable_of(basin, what):
                return float(np.max(np.abs(one)))
    named = [(text, END.get(text.split(".")[0], "") + text.rsplit(".", 1)[-1]) for text in run.probes]
    columns = [k for k, texts in enumerate(named, 1) if name in texts]
    return float(np.max(np.abs(run.rows[:, columns]), initial=0.0))
