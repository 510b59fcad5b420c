"""What a run shows at its end and over time, and how far two runs are apart. Knows fields and probes; no judge."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from fvsolve.studies.accuracy.cells import pipes
from fvsolve.studies.accuracy.plane import end_errors, size_at_end
from fvsolve.studies.outcome import Outcome

END = {"nodes": "nodes at the end: ", "links": "links at the end: "}  # before quantities
NORMS = ("L1", "L2", "max")


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


def fields(model, waves: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict:
    """{pipe: (pressure [Pa], flow [m3/s])} of sums and differences of both waves, averaged over a model's cells."""
    found = {}
    for k, pipe in enumerate(model.pipes):
        total, mass_flow = waves[pipe.name]
        pressure = model.cell_pressure(k, total)
        found[pipe.name] = pressure, (model.tables.pipes[k]["flow"] + mass_flow) / model.case.law.density(pressure)
    return found


def waves(model, y: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Sum and difference of both waves in the cells of every pipe [kg/s]."""
    found = {}
    for row, pipe in zip(model.tables.pipes, model.pipes, strict=True):
        o, n = int(row["y"]), pipe.cells
        r, l = y[o : o + n], y[o + n : o + 2 * n]  # noqa: E741
        found[pipe.name] = r + l, r - l
    return found


def averaged(fine: np.ndarray, cells: int) -> np.ndarray:
    """Averages over fewer or more equal cells; what the cells hold together stays the same to the last bit or so."""
    n = fine.size
    if n % cells == 0:
        return fine.reshape(cells, n // cells).mean(axis=1)
    from scipy.interpolate import make_interp_spline

    contents = np.concatenate([[0.0], np.cumsum(fine)]) / n
    curve = make_interp_spline(np.linspace(0.0, 1.0, n + 1), contents, k=min(5, n))
    return np.diff(curve(np.linspace(0.0, 1.0, cells + 1))) * cells


def differences(run: Outcome, truth, own: tuple[str, ...] | None = None) -> dict[str, dict[str, float]]:
    """Variable -> errors of a run in L1, L2 and max: end fields, probes over time, ends of nodes and links [SI].

    own : probes that are compared over time, all if left out; `recorded` adds further ones for the ends.
    """
    model, found = run.model, {}
    lengths = np.concatenate([np.full(pipe.cells, pipe.length / pipe.cells) for pipe in model.pipes] or [[]])
    if model.pipes:
        mine, theirs = fields(model, waves(model, run.y)), truth.fields(model)
        for k, name in enumerate(("pressure", "flow")):
            apart = np.concatenate([mine[pipe.name][k] - theirs[pipe.name][k] for pipe in model.pipes])
            found[name] = norms(apart, lengths / lengths.sum())
    if model.basins:
        found |= end_errors(model, run.y, truth.fields(model), norms)
    apart = run.rows[:, 1:] - truth.rows(run)
    groups: dict[str, list[float]] = {}
    ends = set(end_probes(model.case))
    for k, name in enumerate(run.probes):
        column = apart[:, k]
        if np.isnan(column).all():
            continue
        if name in ends:
            groups.setdefault(END[name.split(".")[0]] + name.rsplit(".", 1)[1], []).append(column[-1])
        if own is None or name in own:
            found[name] = norms(column, np.full(column.size, 1.0 / column.size))
    for name, values in groups.items():
        found[name] = norms(np.array(values), np.full(len(values), 1.0 / len(values)))
    return found


def norms(apart: np.ndarray, weights: np.ndarray) -> dict[str, float]:
    """Weighted mean, root mean square and greatest of absolute differences."""
    size = np.abs(apart)
    return {
        "L1": float(weights @ size), "L2": math.sqrt(float(weights @ size**2)), "max": float(size.max(initial=0.0))
    }  # fmt: skip


def size_of(run: Outcome, name: str) -> float:
    """How large a variable of a run is."""
    if name in ("pressure", "flow"):
        found = fields(run.model, waves(run.model, run.y))
        k = ("pressure", "flow").index(name)
        return max(float(np.max(np.abs(pair[k]))) for pair in found.values())
    if (known := size_at_end(run, name)) is not None:
        return known
    named = [(text, END.get(text.split(".")[0], "") + text.rsplit(".", 1)[1]) for text in run.probes]
    columns = [k for k, texts in enumerate(named, 1) if name in texts]
    return float(np.max(np.abs(run.rows[:, columns]), initial=0.0))
