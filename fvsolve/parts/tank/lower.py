"""Open tanks in the tables of a model."""

from __future__ import annotations

import numpy as np

from fvsolve.assembly.lowering import Lowering
from fvsolve.kernels import dtypes as rec


class TankRows(Lowering, kind="tank"):
    """Conversion to table rows of tanks: nodes with the hydrostatic pressure at the bottom of their water."""

    ledger_name = "over the rim"

    def place(self, draft, name, node, row) -> None:
        rho = draft.case.law.open_density
        row["kind"], row["level"], row["density"] = rec.TANK, node.level, rho
        if hasattr(node.area, "area"):
            level, area = node.area.level, node.area.area
            volume = np.concatenate(([0.0], np.cumsum(np.diff(level) * 0.5 * (area[1:] + area[:-1]))))
            row["shape"], row["shapes"] = len(draft.floats), len(level)
            if len(level) == 1:
                row["shape"] = -1
            else:
                draft.floats += [*level, *area, *volume]
            row["area"] = area.min()
            contents = lambda z: tank_volume(level, area, volume, z)  # noqa: E731
        else:
            row["area"] = node.area
            contents = lambda z: node.area * z  # noqa: E731
        row["mass"] = rho * contents(node.level)
        if node.height is not None:
            row["full"] = rho * contents(node.height)
        row["stiffness"] = draft.case.gravity / row["area"]
        row["row"] = draft.tanks
        draft.tanks += 1
        row["y"] = draft.states([f"{name}.mass"], 0.1 * rho * row["area"])

    def pressure_at_start(self, start, i, node, row) -> float:
        upright = 1.0 if node.on is None else start.case.poses[node.on].attitude[2, 2]
        return start.law.pressure_under(row["level"] * upright)

    def motion_text(self, name, node, row, inflow, flow, amount) -> str:
        direction = "rises" if flow > 0 else "falls"
        return f"tank {name} {direction} at {amount(abs(flow) / row['area'], 'velocity', silent='mm/s')}"

    def probe(self, draft, name, probe, row) -> None:
        if probe.quantity != "level":
            return super().probe(draft, name, probe, row)
        row["kind"], row["index"] = rec.LEVEL, draft.node_index[draft.inside(name)]


def tank_volume(level, area, volume, z: float) -> float:
    """Volume [m3] of a tank from its bottom to level z [m] above it.

    level, area, volume : levels [m], areas [m2] there and volumes below them [m3]; the area is linear between levels
    and constant above the last level
    """
    if z >= level[-1]:
        return float(volume[-1] + (z - level[-1]) * area[-1])
    k = int(np.searchsorted(level, z, side="right")) - 1
    s = z - level[k]
    return float(volume[k] + s * (area[k] + 0.5 * s * (area[k + 1] - area[k]) / (level[k + 1] - level[k])))
