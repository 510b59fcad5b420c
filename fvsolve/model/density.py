"""The density table of law `table` as kernels read it. Knows a fluid; knows no pipe."""

from __future__ import annotations

import numpy as np


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
