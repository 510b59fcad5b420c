"""Errors of a run against a reference: values in cells at the end, values of probes over time, and extremes.

Errors are in SI or relative to a range, the greatest minus the least value in the reference. A component is a probe, or
a quantity in the cells of a pipe or basin. A relative error of 0.01 is a hundredth of the range of the component. The
argument `truth` is a `Reference`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fvsolve.studies.outcome import NO_FIELDS, Outcome
from fvsolve.studies.resolution import basin_fields, pipes, variable_name

END = {"nodes": "nodes at the end: ", "links": "links at the end: "}  # prefixes of quantities
NORMS = ("L1", "L2", "max")
# ranges below this fraction of the size of a component count as 0; in basins, below this value [SI]
CONSTANT = 1e-9


@dataclass(frozen=True)
class Deviation:
    """Error of a probe at k times, of a quantity in k cells of pipes or a basin, or of k end values of parts.

    error : float64[k]  run minus reference [SI]; weights : float64[k]  durations of the values, lengths or areas of
    cells, or 1
    span : range of the probe or quantity in the reference [SI]; nan if it is constant or not known
    """

    error: np.ndarray
    weights: np.ndarray
    span: float = math.nan

    def norms(self) -> dict[str, float]:
        """Norms of the error [SI]: weighted mean of its magnitude "L1", weighted rms "L2", and maximum "max"."""
        size, share = np.abs(self.error), self.weights / self.weights.sum()
        return {
            "L1": float(share @ size),
            "L2": math.sqrt(float(share @ size**2)),
            "max": float(size.max(initial=0.0)),
        }

    def ranges(self) -> dict[str, float]:
        """The three norms of `norms`, divided by the range `span` [-]."""
        return {norm: value / self.span for norm, value in self.norms().items()}


@dataclass(frozen=True)
class Distance:
    """Errors of a run, relative to ranges in the reference [-]; nan if not known.

    trajectory : greatest mean error of a probe over time; greatest : greatest error of a probe at any time
    end : greatest of two kinds of errors at the end: of a probe, and the mean over the cells of a pipe or basin
    overshoot : greatest amount by which a probe leaves its range in the reference
    worst : probe with the greatest mean error over time
    """

    trajectory: float = math.nan
    greatest: float = math.nan
    end: float = math.nan
    overshoot: float = math.nan
    worst: str = ""


# recorded probes ----------------------------------------------------------------------------------------------------


def recording_keys(case, keys: Mapping | None = None) -> dict:
    """Overrides `keys`, with two more: a run also records the probes of `end_probes`, and writes no values of cells."""
    own = [probe.text for probe in case.probes]
    return {
        **(keys or {}),
        "output.probes": list(dict.fromkeys([*own, *end_probes(case)])),
        **NO_FIELDS,
    }


def end_probes(case) -> list[str]:
    """Probes whose end values are compared: quantities of nodes, and flows of links other than pipes.

    The quantities of nodes are pressure, level, position and velocity. Reservoirs and frames are left out.
    """
    probes = []
    for name, node in case.nodes.items():
        quantities = [
            key for key in ("pressure", "level", "position", "velocity") if key in node.quantities
        ]
        if node.kind not in ("reservoir", "frame"):
            probes += [f"nodes.{name}.{key}" for key in quantities]
    for name, link in case.links.items():
        if "flow" in link.quantities and name not in pipes(case):
            probes.append(f"links.{name}.flow")
    return probes


# measures -----------------------------------------------------------------------------------------------------------


def error_norms(
    run: Outcome, truth, own: tuple[str, ...] | None = None
) -> dict[str, dict[str, float]]:
    """Errors of a run against the `Reference` truth : {variable: {"L1" | "L2" | "max": error [SI]}}.

    Variables are pressure and flow in the cells of all pipes at the end, quantities of basins at the end, probes over
    time, and end values of nodes and links (see `end_probes`), as far as the reference has them.
    own : probes compared over time (default all); `recording_keys` adds probes that are needed only for end values
    """
    deviations, by_component = {}, field_deviations(run, truth)
    for quantity in ("pressure", "flow") if run.model.pipes else ():
        gaps = [by_component[pipe.name, quantity] for pipe in run.model.pipes]
        errors, weights = [gap.error for gap in gaps], [gap.weights for gap in gaps]
        deviations[quantity] = Deviation(np.concatenate(errors), np.concatenate(weights))
    for basin in run.model.meshed:
        by_content = {
            content: by_component.get((basin, content)) for content in basin_fields(basin, run.y)
        }
        deviations |= {
            variable_name(basin, content): gap
            for content, gap in by_content.items()
            if gap is not None
        }
    ends, at_end = set(end_probes(run.model.case)), {}
    for name, gap in probe_deviations(run, truth).items():
        if name in ends:
            at_end.setdefault(END[name.split(".")[0]] + name.rsplit(".", 1)[1], []).append(
                gap.error[-1]
            )
        if own is None or name in own:
            deviations[name] = gap
    deviations |= {
        name: Deviation(np.array(off), np.ones(len(off))) for name, off in at_end.items()
    }
    return {name: gap.norms() for name, gap in deviations.items()}


def distance(run: Outcome, truth) -> Distance:
    """Errors of a run against the `Reference` truth, relative to ranges; all nan if the run did not reach its end.

    Without probes that change, only the error `end` of cells is computed.
    """
    if not run.ok:
        return Distance()
    with np.errstate(invalid="ignore", over="ignore"):
        ends = [
            gap.ranges()["L1"] for gap in field_deviations(run, truth).values() if gap.span > 0.0
        ]
        gaps = moving_probes(run, truth)
        if not gaps:
            return Distance(end=max(ends, default=math.nan))
        means = {name: gap.ranges()["L1"] for name, gap in gaps.items()}
        ends += [abs(float(gap.error[-1])) / gap.span for gap in gaps.values()]
        greatest = max(gap.ranges()["max"] for gap in gaps.values())
        beyond = max(max(high, -low) for low, high in extreme_differences(run, truth))
        worst = max(means, key=means.get)
        return Distance(means[worst], greatest, max(ends), max(0.0, beyond), worst)


def extremes_distance(run: Outcome, truth) -> float:
    """Greatest error of the least and greatest values of all probes, each relative to the range of its probe.

    The result is nan if all probes are constant. truth : the `Reference`
    """
    return max(
        (max(abs(low), abs(high)) for low, high in extreme_differences(run, truth)),
        default=math.nan,
    )


def extreme_differences(run: Outcome, truth) -> list[tuple[float, float]]:
    """(error of the least value, error of the greatest value) of each probe that changes, relative to its range [-].

    An error is the value of the run minus that of the `Reference` truth.
    """
    values, reference_values = run.rows[:, 1:], truth.rows(run)
    span = column_ranges(reference_values)
    low, high = (
        (pick(values, axis=0) - pick(reference_values, axis=0)) / span for pick in (np.min, np.max)
    )
    return [(float(low[k]), float(high[k])) for k in np.flatnonzero(span > 0.0)]


# components ---------------------------------------------------------------------------------------------------------


def moving_probes(run: Outcome, truth) -> dict[str, Deviation]:
    """Errors of the probes that change in the `Reference` truth : probe -> `Deviation` over time."""
    return {name: gap for name, gap in probe_deviations(run, truth).items() if gap.span > 0.0}


def probe_deviations(run: Outcome, truth) -> dict[str, Deviation]:
    """Errors of the probes that have values in the `Reference` truth : probe -> `Deviation` over time."""
    weights, reference_values = time_weights(run.rows[:, 0]), truth.rows(run)
    off, span = run.rows[:, 1:] - reference_values, column_ranges(reference_values)
    columns = [k for k in range(len(run.probes)) if not np.isnan(reference_values[:, k]).all()]
    return {run.probes[k]: Deviation(off[:, k], weights, float(span[k])) for k in columns}


def field_deviations(run: Outcome, truth) -> dict[tuple, Deviation]:
    """Errors in cells at the end of a run : (pipe name or basin object, quantity) -> `Deviation`.

    The range of a pressure in a pipe is that over the run; the range of its flow is this range times A / (rho a), with
    area A, density rho and wave speed a. The range of a quantity in a basin is that over the cells at the end; flows
    along x and y both have the greater of their two ranges. All ranges are those of the `Reference` truth; ranges of
    pipes that are not in its `spans` are nan. Basins without values in the reference are left out.
    """
    model, deviations = run.model, {}
    reference_fields = truth.fields(model) if model.pipes or model.meshed else {}
    own_fields = fields(model, wave_sums(run)) if model.pipes else {}
    for k, pipe in enumerate(model.pipes):
        lengths = np.full(pipe.cells, pipe.length / pipe.cells)
        span = truth.spans.get(pipe.name, math.nan)
        flow_per_pressure = (
            float(model.tables.pipes[k]["admittance"]) / model.case.properties.density
        )
        widths = {"pressure": span, "flow": span * flow_per_pressure}
        for quantity, values, expected in zip(
            widths, own_fields[pipe.name], reference_fields[pipe.name], strict=True
        ):
            deviations[pipe.name, quantity] = Deviation(
                values - expected, lengths, widths[quantity]
            )
    for basin in model.meshed:
        reference_basin = reference_fields.get(("basin", basin.name))
        if reference_basin is None:
            continue
        spans = np.ptp(reference_basin, axis=1)
        if len(spans) >= 3 and basin.quantities:
            spans[1:3] = spans[1:3].max()
        for (content, values), reference_values, span in zip(
            basin_fields(basin, run.y).items(), reference_basin, spans, strict=True
        ):
            span = float(span) if span > CONSTANT else math.nan
            deviations[basin, content] = Deviation(values - reference_values, basin.mesh.area, span)
    return deviations


def time_weights(t: np.ndarray) -> np.ndarray:
    """Weights of the trapezoidal rule [s] for a mean over values at the times t [s]; all 1 if all times are equal."""
    steps = 0.5 * np.diff(t)
    weights = np.append(steps, 0.0) + np.append(0.0, steps)
    return weights if weights.sum() > 0.0 else np.ones(t.size)


def column_ranges(values: np.ndarray) -> np.ndarray:
    """Greatest minus least value of every column : float64[columns], nan for constant columns."""
    span, size = np.ptp(values, axis=0), np.abs(values).max(axis=0)
    return np.where(span > CONSTANT * size, span, np.nan)


def pressure_ranges(envelope: Mapping[str, Mapping]) -> dict[str, float]:
    """Range of the pressure in each pipe over cells and run [Pa], nan if constant; envelope : as in `Outcome`."""
    pressures = {
        name: np.append(entry["min_pressure"], entry["max_pressure"])
        for name, entry in envelope.items()
    }
    return {name: float(column_ranges(entry)) for name, entry in pressures.items()}


# fields -------------------------------------------------------------------------------------------------------------


def fields(model, waves: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict:
    """Pressures and flows in the cells of all pipes : {pipe: (float64[cells] [Pa], float64[cells] [m3/s])}.

    waves : pipe -> (r + l, r - l), cell averages of the forward wave r and the backward wave l [kg/s]
    """
    by_pipe = {}
    for k, pipe in enumerate(model.pipes):
        total, mass_flow = waves[pipe.name]
        pressure = model.cell_pressure(k, total)
        by_pipe[pipe.name] = (
            pressure,
            (model.tables.pipes[k]["flow"] + mass_flow) / model.case.law.density(pressure),
        )
    return by_pipe


def wave_sums(run: Outcome) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Forward waves r and backward waves l at the end of a run : pipe -> (r + l, r - l), float64[cells] each [kg/s]."""
    sums = dict(run.lines)
    for row, pipe in zip(run.model.tables.pipes, run.model.pipes, strict=True):
        if pipe.name not in sums:
            o, n = int(row["y"]), pipe.cells
            r, l = run.y[o : o + n], run.y[o + n : o + 2 * n]  # noqa: E741
            sums[pipe.name] = r + l, r - l
    return sums


def cell_averages(fine: np.ndarray, cells: int) -> np.ndarray:
    """Averages over `cells` equal cells, from averages `fine` over another number of equal cells of the same pipe.

    The integral is conserved to rounding. If the old number is not a multiple of `cells`, the cumulative integral is
    interpolated by a spline of degree 5, or of degree n for n < 5 cells in `fine`.
    """
    n = fine.size
    if n % cells == 0:
        return fine.reshape(cells, n // cells).mean(axis=1)
    from scipy.interpolate import make_interp_spline

    integral = np.concatenate([[0.0], np.cumsum(fine)]) / n
    curve = make_interp_spline(np.linspace(0.0, 1.0, n + 1), integral, k=min(5, n))
    return np.diff(curve(np.linspace(0.0, 1.0, cells + 1))) * cells


def variable_size(run: Outcome, name: str) -> float:
    """Greatest absolute value of a variable over its cells or times [SI]; name : variable as in `error_norms`."""
    if name in ("pressure", "flow"):
        k = ("pressure", "flow").index(name)
        return max(
            float(np.max(np.abs(pair[k]))) for pair in fields(run.model, wave_sums(run)).values()
        )
    for basin in run.model.meshed:
        for quantity, values in basin_fields(basin, run.y).items():
            if name == variable_name(basin, quantity):
                return float(np.max(np.abs(values)))
    named = [
        (text, END.get(text.split(".")[0], "") + text.rsplit(".", 1)[-1]) for text in run.probes
    ]
    columns = [k for k, texts in enumerate(named, 1) if name in texts]
    return float(np.max(np.abs(run.rows[:, columns]), initial=0.0))
