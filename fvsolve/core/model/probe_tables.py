"""Table of probes: data that each probe reads, with scale and offset, in SI units."""

import numpy as np

from fvsolve.core.assembly.lowering import lowering_of
from fvsolve.core.kernels import dtypes as rec


def lower_probes(draft) -> np.ndarray:
    """Table of all probes (`all_probes`). Data of the initial steady state are filled in later, by `probe_offsets`."""
    return fill_probes(draft, all_probes(draft.case))


def fill_probes(draft, probes: list) -> np.ndarray:
    """Table with a row for each of these probes."""
    case, table = draft.case, np.zeros(len(probes), rec.PROBE)
    parts = {"nodes": {**case.places, **case.nodes}, "links": {**case.links, **case.conduits}}
    for row, probe in zip(table, probes, strict=True):
        row["mark"] = -1
        if any(feature.probe(draft, probe, row) for feature in draft.features):
            continue
        part = parts[probe.part][probe.name]
        lowering_of(type(part)).of(part).probe(draft, probe.name, probe, row)
    return table


def all_probes(case) -> list:
    """All probes that are read after every step: those of the case, then quantities of which only extremes are kept."""
    return [*case.probes, *case.extreme_probes]


def cells_at_point(draft, row, probe) -> tuple[np.ndarray, np.ndarray]:
    """Cells of a mesh that a probe at a point reads, and their weights, after they are written to its row."""
    k = list(draft.case.meshes).index(probe.name)
    cells, weights = draft.meshed[k].points.cell_weights(*probe.point)
    row["index"], row["count"], row["cell"] = k, cells.size, len(draft.integers)
    row["weights"] = len(draft.floats)
    draft.integers += cells.tolist()
    draft.floats += weights.tolist()
    return cells, weights


def probe_offsets(draft, start) -> None:
    """Set scale and offset of the probes of nodes and links from the initial steady state.

    Probes of meshes and features, and of forces on pipes, do not need them. Also sets the steady pressures of watched
    quantities along pipes.
    """
    count = len(draft.case.probes)
    draft.watched_start = np.full(len(draft.probe_table) - count, np.nan)
    for k, (row, probe) in enumerate(
        zip(draft.probe_table[count:], draft.case.extreme_probes, strict=True)
    ):
        if probe.straight and row["kind"] == rec.PIPE_PRESSURE:
            draft.watched_start[k] = start.profile_at(int(row["index"]), probe.fraction)[0]
    pairs = [*zip(draft.probe_table, all_probes(draft.case), strict=True)]
    for feature in draft.features:
        pairs += zip(*feature.probe_rows(), strict=True)
    for row, probe in pairs:
        if row["kind"] >= rec.CELL_FIELD and row["kind"] != rec.PRESSURE_BETWEEN:
            continue  # meshes hold the profile of theirs, the others need none
        if draft.case.law.linear:
            linear_offsets(draft, start, row, probe)
        else:
            barotropic_offsets(draft, start, row, probe)


def linear_offsets(draft, start, row, probe) -> None:
    """Set scale and offset of a probe under the density law `linear`.

    Its value is scale * (deviation of the pressure, or flow) + offset.
    """
    weight = draft.fluid.density * draft.case.gravity
    row["scale"], row["offset"] = 1.0, 0.0
    if row["kind"] in (rec.VALVE_FLOW, rec.COLUMN_FLOW, rec.PIPE_FLOW, rec.SPOOL_FLOW):
        # out of the end `to` of a conduit
        leaves = row["kind"] == rec.VALVE_FLOW and row["side"] < 0
        row["scale"] = (-1.0 if leaves else 1.0) / draft.fluid.density
        if probe.quantity == "velocity":
            is_pipe, floats = row["kind"] == rec.PIPE_FLOW, draft.tables.floats
            row["scale"] /= (
                draft.pipe_table[row["index"]]["area"] if is_pipe else floats[row["weights"]]
            )
    elif row["kind"] in (rec.PRESSURE, rec.PIPE_PRESSURE, rec.PRESSURE_BETWEEN):
        if row["kind"] == rec.PRESSURE:
            base, z = (draft.node_table[row["index"]][key] for key in ("pressure", "elevation"))
        elif row["kind"] == rec.PRESSURE_BETWEEN:
            x, z, lower = draft.tables.floats[row["weights"] :][:3]
            base = lower + (1.0 - x) * draft.node_table["pressure"][row["index"]]
            base += x * draft.node_table["pressure"][row["cell"]]
        else:
            base, z = start.profile_at(int(row["index"]), probe.fraction)
            row["scale"] = 1.0 / draft.pipe_table[row["index"]]["admittance"]
        row["offset"] = base - (
            0.0 if probe.quantity == "pressure" else draft.case.ambient_pressure
        )
        place = draft.case.places.get(probe.name)
        is_level = probe.quantity == "level" and hasattr(place, "basin")
        if probe.quantity == "head" or is_level:
            divisor = weight if weight > 0.0 else np.nan  # without gravity there is no head
            row["scale"] /= divisor
            row["offset"] = row["offset"] / divisor + z
        if is_level:
            row["offset"] -= draft.case.nodes[place.basin].elevation or 0.0


def barotropic_offsets(draft, start, row, probe) -> None:
    """Set offset, code `head` and mass per length of a probe under density laws other than `linear`.

    With the offset, kernels convert a pressure to gauge pressure or head. The mass per length is that of the steady
    state at a probe along a pipe.
    """
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
        elif row["kind"] == rec.PRESSURE_BETWEEN:
            row["offset"] = draft.tables.floats[row["weights"] + 1]
        else:
            row["offset"] = start.profile_at(int(row["index"]), probe.fraction)[1]
        if draft.case.gravity == 0.0:
            row["offset"] = np.nan
