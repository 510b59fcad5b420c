"""Notices of unusual values of water with a free surface: roughness, slopes under rain, inflows, narrow structures."""

from collections.abc import Iterator

import numpy as np

from fvsolve.errors import Notice, listing
from fvsolve.features.basins.free_surface.part import RAIN
from fvsolve.parts.basin import MANNING_RANGE
from fvsolve.parts.field_series import SpatialSeries
from fvsolve.parts.formula import SpatialField
from fvsolve.parts.raster import Raster
from fvsolve.parts.weir.part import HydraulicStructure

MM_PER_H = 3.6e6  # mm/h in 1 m/s
# slope above which a pixel of a bed is rather a value that stands for missing data, such as -9999 m
CLIFF = 50.0
STEEP = 0.1  # slope above which rain runs off otherwise than shallow-water theory assumes
TIMES = 1001  # times at which a scheduled inflow is compared with critical flow, beside its own


def unusual_values(basin) -> Iterator[Notice]:
    """Notices that the case of a basin determines, without its states."""
    place = f"nodes.{basin.name}"
    if isinstance(basin.part.manning, SpatialField):
        low, high = float(basin.roughness.min()), float(basin.roughness.max())
        least, greatest, meaning = MANNING_RANGE
        odd = low if 0.0 < low < least else high
        if 0.0 < odd < least or odd > greatest:
            text = f"{place}.manning: {odd:.3g} s/m^(1/3) in a cell is outside {least} to {greatest}, {meaning}"
            yield Notice("range", place, text, "manning", odd, least if odd < least else greatest)
    bed = basin.part.bed
    is_raster = isinstance(bed, SpatialField) and isinstance(bed.rule, Raster)
    slope = steepest(basin) if basin.rains or is_raster else 0.0
    if is_raster and slope > CLIFF:
        text = f"{place}.bed: slopes up to {slope:.3g} between adjacent cells, for heights in the basin from "
        text += f"{basin.bed.min():.6g} to {basin.bed.max():.6g} m; "
        text += f"does {bed.rule.name} state its value of missing data?"
        yield Notice("range", place, text, "bed", slope, CLIFF)
    elif basin.rains and slope > STEEP:
        text = f"{basin.name}: rain falls on a bed with slopes up to {slope:.3g}, between adjacent cells"
        text += f"; shallow-water theory, with vertical depths, is for slopes below {STEEP:g}"
        yield Notice("slope", place, text, "bed", slope, STEEP)
    if basin.rains:
        yield from intense_formula(basin)
    for name, patch in basin.part.patches.items():
        if patch.depth is not None and "control" not in (patch.depth.kind, patch.discharge.kind):
            yield from subcritical_inflow(basin, name, patch)
    for name in basin.linked:
        yield from structures_of_unusual_width(basin, name)


def intense_formula(basin) -> Iterator[Notice]:
    """Notice of a formula of place for rain, with a rate in a cell above that of cloudbursts.

    Other rates are compared when the case is read.
    """
    place, rain = f"nodes.{basin.name}", basin.part.rain
    most = (
        float(rain.over(basin.mesh).max())
        if isinstance(rain, SpatialSeries) and rain.value == 0.0
        else 0.0
    )
    if most > RAIN.greatest:
        text = f"{place}.rain: {most * MM_PER_H:.4g} mm/h is above {RAIN.greatest * MM_PER_H:g} mm/h, {RAIN.source}"
        yield Notice("range", place, text, "rain", most, RAIN.greatest)


def steepest(basin) -> float:
    """Greatest slope of the bed between the centres of adjacent cells."""
    mesh = basin.mesh
    left, right = mesh.left[: mesh.inner], mesh.right[: mesh.inner]
    far = np.hypot(*(mesh.centre[right] - mesh.centre[left]).T)
    return float(np.max(np.abs(basin.bed[right] - basin.bed[left]) / far, initial=0.0))


def froude(basin, name: str, flow: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Froude numbers of an inflow [m3/s] with a depth [m] through a patch."""
    wide = basin.mesh.length[basin.mesh.faces(name).index].sum()
    return flow / (wide * depth * np.sqrt(basin.case.gravity * depth))


def subcritical_inflow(basin, name: str, patch) -> Iterator[Notice]:
    """Notice of a stated depth at which the inflow is slower than waves, so that the basin determines the depth."""
    from fvsolve.exact.solution import value

    numerics, amount = basin.case.numerics, basin.case.amount
    t = np.union1d(
        np.linspace(numerics.start, numerics.end, TIMES), [*patch.discharge.time, *patch.depth.time]
    )
    t = t[(t >= numerics.start) & (t <= numerics.end)]
    flow, depth = value(patch.discharge, t), value(patch.depth, t)
    inward = (flow > 0.0) & (depth > 0.0)
    number = np.where(inward, froude(basin, name, flow, np.where(inward, depth, 1.0)), np.inf)
    k = int(np.argmin(number))
    if number[k] < 1.0:
        given = f"{amount(flow[k], 'flow')} at a depth of {amount(depth[k], 'length')}"
        text = (
            f"{basin.name}.{name}: the inflow of {given} is subcritical at {basin.case.moment(t[k], 4)} (Froude number "
            f"{number[k]:.3g}); leave out `depth`, which the water in the basin determines"
        )
        yield Notice(
            "range", f"nodes.{basin.name}", text, f"patches.{name}.depth", float(number[k]), 1.0
        )


def structures_of_unusual_width(basin, name: str) -> Iterator[Notice]:
    """Notices of structures at a patch that are narrower than its cells, or wider than the patch and its side."""
    place, sides = f"{basin.name}.{name}", basin.mesh.length[basin.mesh.faces(name).index]
    side = basin.part.patches[name].side if name in basin.part.patches else None
    size = basin.part.size
    whole = max(float(sides.sum()), size[side in ("west", "east")] if side and size else 0.0)
    widths = {
        link: (getattr(part, "width", None) or getattr(part, "diameter", None))
        * getattr(part, "barrels", 1)
        for link, part in basin.case.links.items()
        if isinstance(part, HydraulicStructure)
        and place in part.ports.values()
        and hasattr(part, "width")
    }
    narrow = [link for link, width in widths.items() if width < sides.min() * (1.0 - 1e-9)]
    wide = [link for link, width in widths.items() if width > whole * (1.0 + 1e-9)]
    for links, word, size, text in (
        (
            narrow,
            "narrower than the cells at",
            sides.min(),
            "the flow spreads over the cells; use smaller cells where velocities beside it matter",
        ),
        (
            wide,
            "wider than the side of" if side else "wider than",
            whole,
            "no more than critical flow through the patch passes; give the width that is in the basin",
        ),
    ):
        if links:
            verb = "is" if len(links) == 1 else "are"
            size = basin.case.amount(float(size), "length")
            yield Notice(
                "cells",
                f"links.{links[0]}",
                f"{listing(links)} {verb} {word} {place}, {size}: {text}",
                "width",
            )


class InflowWatch:
    """Scheduled inflow through a patch without `depth`, where only critical inflow balances the water inside.

    greatest : float64[3]  time [s], inflow [m3/s], and greatest inflow slower than waves [m3/s] at the last check
    """

    def __init__(self, basin, name: str) -> None:
        self.basin, self.name, self.greatest = basin, name, np.zeros(3)
        faces = basin.mesh.faces(name)
        self.cells, self.normal, self.length = (
            faces.behind,
            faces.normal,
            basin.mesh.length[faces.index],
        )

    def check(self, t: float, y: np.ndarray) -> None:
        """Store the inflow and its limit for a state y of the model at time t [s]."""
        from fvsolve.exact.solution import value

        basin, states = self.basin, self.basin.deviations(y)
        depth = basin.depth_of(states)[self.cells]
        outward = (states[1][self.cells], states[2][self.cells]) * self.normal.T
        u = -outward.sum(axis=0) / np.maximum(depth, 1e-9)
        c = np.sqrt(basin.case.gravity * depth)
        limit = float(np.sum(self.length * np.maximum(2.0 * c - u, 0.0) ** 3) / basin.case.gravity)
        self.greatest[:] = (
            t,
            float(value(basin.part.patches[self.name].discharge, np.array([t]))[0]),
            limit,
        )

    def notices(self) -> list[Notice]:
        """List with the notice of an inflow held at critical flow at the end; empty if it is slower than waves."""
        t, flow, limit = self.greatest.tolist()
        if not flow > limit:
            return []
        basin, amount = self.basin, self.basin.case.amount
        text = (
            f"{basin.name}.{self.name}: the inflow of {amount(flow, 'flow')} at {basin.case.moment(t, 4)} enters at "
            "critical depth, because the water inside runs off faster than waves or is shallow; give the `depth` "
            "of a supercritical inflow"
        )
        return [
            Notice(
                "range", f"nodes.{basin.name}", text, f"patches.{self.name}.discharge", flow, limit
            )
        ]


def inflow_watches(basin) -> list[InflowWatch]:
    """Watches of the scheduled inflows without `depth`; the output of a control is not known in advance."""
    return [
        InflowWatch(basin, name)
        for name, patch in basin.part.patches.items()
        if not patch.is_interior
        and patch.discharge is not None
        and patch.depth is None
        and patch.discharge.kind != "control"
    ]
