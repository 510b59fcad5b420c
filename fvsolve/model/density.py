"""The laws `table` and `mixture` as kernels read them. Knows a fluid; knows no pipe."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice
from fvsolve.fluid import ATMOSPHERE
from fvsolve.kernels import records as rec

DURATION, RATE = 1.03, 0.7  # a first cavity is too short by the one times cells to minus the other (docs/cavitation.md)
ENOUGH = 200  # cells from which on nothing is said of it
LAWS = {"linear": rec.LAW_LINEAR, "log": rec.LAW_LOG, "table": rec.LAW_TABLE, "mixture": rec.LAW_MIXTURE}


def add_law(fluid, s, floats: list[float]) -> None:
    """A fluid's density law and what it needs; a mixture with nothing mixed in is `log`."""
    s["rho"], s["beta"], s["reference"] = fluid.density, fluid.bulk_modulus, fluid.pressure
    s["law"] = LAWS[fluid.law]
    if fluid.table is not None:
        add_density_table(fluid, s, floats)
    if fluid.law == "mixture":
        add_mixture(fluid, s)


def density_of(fluid, pressure: float) -> float:
    """Density [kg/m3] of a fluid at a pressure, under any law but `linear`."""
    from fvsolve.kernels.density import density

    settings, floats = np.zeros(1, rec.SETTINGS), []
    add_law(fluid, settings[0], floats)
    return density(settings[0], np.array(floats), float(pressure))


def coarse_for_cavities(draft) -> list[Notice]:
    """A note where the pipe that waves take longest to pass has few cells for the cavities that the law follows."""
    air, pipes = draft.fluid.air, draft.meshes
    if air is None or not air.cavitation or not pipes:
        return []
    longest = max(pipes, key=lambda pipe: pipe.length / pipe.wave_speed)
    if longest.cells >= ENOUGH:
        return []
    found = DURATION * longest.cells**-RATE
    better = DURATION * ENOUGH**-RATE
    text = (f"{longest.name}: with {longest.cells} cells a first cavity lasts some {100.0 * found:.2g} % too short "
            f"where little dampens it; {ENOUGH} cells bring that to {100.0 * better:.2g} %")  # fmt: skip
    return [Notice("cells", f"links.{longest.name}", text, "cells", float(longest.cells), float(ENOUGH))]


def cavity_pressure(fluid) -> float:
    """Pressure [Pa] below which a place is a cavity: more vapour than gas; without cavitation, the vapour pressure."""
    return fluid.vapor_pressure * (2.0 if fluid.air is not None and fluid.air.cavitation else 1.0)


def add_mixture(fluid, s) -> None:
    """The gas: `air_fraction` of the volume at 1 atm, over the liquid's volume at the reference pressure."""
    air = fluid.air
    if air is None or air.fraction == 0.0:
        s["law"] = rec.LAW_LOG
        return
    s["floor"] = fluid.vapor_pressure if air.cavitation else 0.0
    s["gas_power"], s["saturation"] = 1.0 / air.exponent, air.saturation_pressure - s["floor"]
    x = ATMOSPHERE - s["floor"]
    liquid = 1.0 - (ATMOSPHERE - fluid.pressure) / fluid.bulk_modulus
    free = air.fraction / (1.0 - air.fraction) * liquid
    s["gas"] = free * x ** s["gas_power"] / (1.0 - x / s["saturation"])


def add_density_table(fluid, s, floats: list[float]) -> None:
    """The density table: ln(rho / rho_ref), its slope, enthalpy and its slope, on a uniform grid."""
    table, n = fluid.table, len(fluid.table.pressure)
    p, k = np.asarray(table.pressure), np.asarray(table.compressibility)
    step = (p[-1] - p[0]) / (n - 1)
    s["table"], s["table_size"], s["table_start"], s["table_step"] = len(floats), n, p[0], step
    value = hermite_at(p, np.asarray(table.log_density), k, fluid.pressure)
    log_density = np.asarray(table.log_density) - value
    nodes, weights = np.polynomial.legendre.leggauss(6)
    h = np.zeros(n)
    for x, w in zip(nodes, weights, strict=True):
        at = p[:-1] + 0.5 * (1.0 + x) * step
        h[1:] += 0.5 * w * step / (fluid.density * np.exp(hermite_at(p, log_density, k, at)))
    h = np.cumsum(h)
    slope = 1.0 / (fluid.density * np.exp(log_density))
    h -= hermite_at(p, h, slope, fluid.pressure)
    floats += [*log_density, *k, *h, *slope]


def hermite_at(grid, values, slopes, at):
    """Cubic Hermite interpolant of a uniform table at given places."""
    step = grid[1] - grid[0]
    k = np.clip(((at - grid[0]) / step).astype(int) if hasattr(at, "astype") else int((at - grid[0]) / step), 0,
                len(grid) - 2)  # fmt: skip
    s = (at - grid[k]) / step
    r = 1.0 - s
    rise = values[k + 1] - values[k]
    return values[k] + s * s * (3 - 2 * s) * rise + s * r * step * (r * slopes[k] - s * slopes[k + 1])
