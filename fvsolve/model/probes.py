"""Probes lowered to records: what to read and how to weigh it. Knows units of nothing but SI."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.parts import EDGES
from fvsolve.schemes import SCHEMES

TIE = 1e-6  # of a cell, within which two sets of cells are as near
SPOOL_FLOWS = {  # flow into the link at a port: weights of its four edges
    f"flow_{port}": [float((port == start) - (port == end)) for start, end, _ in EDGES] for port in "PTAB"
}


def lower_probes(draft) -> np.ndarray:
    """The probe table of a scene; pressures of the profile are filled in later by `probe_offsets`."""
    table = np.zeros(len(draft.case.probes), rec.PROBE)
    for row, probe in zip(table, draft.case.probes, strict=True):
        name = inside(draft, probe)
        if probe.point is not None:
            lower_point(draft, row, probe)
        elif probe.part == "nodes" and probe.quantity == "flow":
            row["index"], row["kind"] = draft.node_index[probe.name], rec.PATCH_FLOW
            row["scale"] = 1.0 / draft.fluid.density
            basin = draft.case.places[probe.name].basin
            if draft.case.nodes[basin].physics == "transport":
                patches = draft.patch_table["node"].tolist()
                row["index"], row["kind"] = patches.index(row["index"]), rec.GIVEN_FLOW
        elif probe.quantity in draft.case.scalars:
            scalar_probe(draft, row, probe, name)
        elif name in draft.device_names and probe.quantity in draft.device_of(name).quantities:
            row["index"], row["kind"] = draft.device_names.index(name), rec.DEVICE_VALUE
            row["side"] = draft.device_of(name).quantities.index(probe.quantity)
        elif probe.part == "nodes" and probe.name in draft.body_index:
            row["index"] = draft.body_index[probe.name]
            row["kind"] = rec.POSITION if probe.quantity == "position" else rec.VELOCITY
        elif probe.part == "nodes":
            row["index"] = draft.node_index[name if probe.quantity == "level" else probe.name]
            row["kind"] = rec.LEVEL if probe.quantity == "level" else rec.PRESSURE
        elif probe.quantity == "force":
            row["index"], row["kind"] = draft.push_names.index(probe.name), rec.FORCE
        elif probe.name in draft.piston_names:
            row["index"] = draft.piston_names.index(probe.name)
            row["kind"] = rec.PISTON_POSITION if probe.quantity == "position" else rec.PISTON_VELOCITY
        elif probe.quantity in SPOOL_FLOWS:
            row["index"], row["kind"] = draft.valve_names.index(probe.name), rec.SPOOL_FLOW
            row["weights"] = len(draft.floats)
            draft.floats += SPOOL_FLOWS[probe.quantity]
        elif probe.name in draft.valve_names:
            row["index"], row["kind"] = draft.valve_names.index(probe.name), rec.VALVE_FLOW
        elif probe.name in draft.column_names:
            row["index"], row["kind"] = draft.column_names.index(probe.name), rec.COLUMN_FLOW
        else:
            row["index"] = draft.pipe_names.index(probe.name)
            row["kind"] = rec.PIPE_FLOW if probe.quantity in ("flow", "velocity") else rec.PIPE_PRESSURE
            place(draft, row, probe.fraction)
    return table


def scalar_probe(draft, row, probe, name: str) -> None:
    """Of a scalar at a node or along a pipe, there straight between the centres of cells."""
    row["scalar"] = list(draft.case.scalars).index(probe.quantity)
    if probe.part == "nodes":
        row["kind"], row["index"] = rec.NODE_SCALAR, draft.node_index[name]
    else:
        row["kind"], row["index"] = rec.PIPE_SCALAR, draft.pipe_names.index(probe.name)
        place(draft, row, probe.fraction, 1)


def inside(draft, probe) -> str:
    """What lies behind the connection of a part, or the part itself."""
    name = f"{probe.name}.inside"
    return name if probe.part == "nodes" and name in draft.node_index else probe.name


def lower_point(draft, row, probe) -> None:
    """The cells of a basin that a probe reads, and their weights."""
    k = list(draft.case.meshes).index(probe.name)
    basin = draft.basins[k]
    cells, weights = basin.points.reading(*probe.point)
    row["index"], row["count"], row["cell"] = k, cells.size, len(draft.integers)
    row["weights"] = len(draft.floats)
    draft.integers += cells.tolist()
    draft.floats += weights.tolist()
    if probe.quantity in draft.case.scalars:
        row["kind"], row["scalar"] = rec.CELL_SCALAR, list(draft.case.scalars).index(probe.quantity)
    else:
        basin.lower_probe(row, probe.quantity, cells, weights)


def place(draft, row, fraction: float, degree: int | None = None) -> None:
    """Where along its pipe a probe reads: an end, or cells by a polynomial, of the scheme's degree if left out."""
    if fraction in (0.0, 1.0):
        row["side"] = -1 if fraction == 0.0 else 1
        return
    n = int(draft.pipe_table[row["index"]]["cells"])
    degree = min(degree or max(SCHEMES[draft.case.numerics.scheme].degree, 1), n - 1)
    first, weights = around(fraction * n, degree, n)
    row["cell"], row["count"], row["weights"] = first, weights.size, len(draft.floats)
    draft.floats += weights.tolist()


def around(x: float, degree: int, n: int) -> tuple[int, np.ndarray]:
    """First of the cells that are read x cells from `from`, and their weights.

    They are the nearest degree + 1; where two such sets are as near, as on a face for an even degree, it is the mean
    of both, so that a pipe drawn the other way reads the same.
    """
    middle = x - 0.5 * (degree + 1)
    firsts = sorted({int(np.clip(round(middle + side), 0, n - degree - 1)) for side in (-TIE, TIE)})
    weights = np.zeros(firsts[-1] - firsts[0] + degree + 1)
    for first in firsts:
        weights[first - firsts[0] :][: degree + 1] += reading_weights(x - first, degree) / len(firsts)
    return firsts[0], weights


def reading_weights(x: float, degree: int) -> np.ndarray:
    """Weights w with sum w_k (average over [k, k+1]) = value at x, exact for polynomials up to `degree`."""
    powers = np.arange(degree + 1)
    cells = np.arange(degree + 1)[:, None]
    averages = ((cells + 1.0) ** (powers + 1) - cells ** (powers + 1.0)) / (powers + 1)
    return np.linalg.solve(averages.T, float(x) ** powers)


def probe_offsets(draft, start) -> None:
    """Scale and offset of every probe, once the profile is known."""
    for row, probe in zip(draft.probe_table, draft.case.probes, strict=True):
        if row["kind"] >= rec.CELL_STATE:  # their profile is known to basins
            continue
        if draft.case.law.linear:
            linear_offsets(draft, start, row, probe)
        else:
            barotropic_offsets(draft, start, row, probe)


def linear_offsets(draft, start, row, probe) -> None:
    """scale * (deviation of pressure or flow) + offset."""
    weight = draft.fluid.density * draft.case.gravity
    row["scale"], row["offset"] = 1.0, 0.0
    if row["kind"] in (rec.VALVE_FLOW, rec.COLUMN_FLOW, rec.PIPE_FLOW, rec.SPOOL_FLOW):
        row["scale"] = 1.0 / draft.fluid.density
        if probe.quantity == "velocity":
            row["scale"] /= draft.pipe_table[row["index"]]["area"]
    elif row["kind"] in (rec.PRESSURE, rec.PIPE_PRESSURE):
        if row["kind"] == rec.PRESSURE:
            base, z = (draft.node_table[row["index"]][key] for key in ("pressure", "elevation"))
        else:
            base, z = start.profile_at(int(row["index"]), probe.fraction)
            row["scale"] = 1.0 / draft.pipe_table[row["index"]]["admittance"]
        row["offset"] = base - (0.0 if probe.quantity == "pressure" else draft.case.ambient_pressure)
        if probe.quantity == "head":
            row["scale"] /= weight
            row["offset"] = row["offset"] / weight + z


def barotropic_offsets(draft, start, row, probe) -> None:
    """What turns a pressure into gauge pressure or head, and the profile's mass per length at the place."""
    if row["kind"] == rec.DEVICE_VALUE:
        return
    if row["kind"] in (rec.PIPE_PRESSURE, rec.PIPE_FLOW):
        row["mass"] = start.mass_at(int(row["index"]), probe.fraction)
    if probe.quantity == "gauge_pressure":
        row["offset"] = -draft.case.ambient_pressure
    elif probe.quantity == "velocity":
        row["head"] = 2
    elif probe.quantity == "head":
        row["head"] = 1
        if row["kind"] == rec.PRESSURE:
            row["offset"] = draft.node_table[row["index"]]["elevation"]
        else:
            row["offset"] = start.profile_at(int(row["index"]), probe.fraction)[1]
