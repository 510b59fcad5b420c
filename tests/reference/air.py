"""Oil with air from the physics, and a drive filled with it: pressures as states. Knows SciPy; knows no fvsolve."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

ATM = 101325.0


@dataclass
class AirOil:
    """A mass of liquid takes v = (1 - (p - p_ref) / K) / rho, its gas a v_atm (p_atm / p)^(1/n) / (1 - a) at 1 atm."""

    rho: float = 870.0
    modulus: float = 1.6e9
    fraction: float = 0.01
    exponent: float = 1.0
    saturation: float = math.inf
    reference: float = ATM
    floor: float = 0.0

    def liquid(self, p):
        return 1.0 - (p - self.reference) / self.modulus

    def gas(self, p):
        """Free gas over the liquid's volume at the reference pressure; SciPy's trial steps may leave its pressures."""
        x, atm, end = max(p - self.floor, 1e-3), ATM - self.floor, self.saturation - self.floor
        left = (1.0 - x / end) / (1.0 - atm / end) if x < end else 0.0
        return self.fraction / (1.0 - self.fraction) * self.liquid(ATM) * (atm / x) ** (1.0 / self.exponent) * left

    def density(self, p):
        return self.rho / (self.liquid(p) + self.gas(p))

    def modulus_at(self, p):
        """Effective bulk modulus -V dp/dV [Pa]: 1/K_eff = (1 - g) / K_l + g / (n p) + g / (p_sat - p)."""
        g = self.gas(p) / (self.liquid(p) + self.gas(p))
        dissolving = g / (self.saturation - p) if g > 0.0 else 0.0
        return 1.0 / ((1.0 - g) / (self.liquid(p) * self.modulus) + g / (self.exponent * (p - self.floor)) + dissolving)


def orifice(area: float, up: float, down: float, oil: AirOil) -> float:
    """Mass flow [kg/s] at the density upstream, effective area [m2]."""
    return math.copysign(area * math.sqrt(2.0 * oil.density(max(up, down)) * abs(up - down)), up - down)


def follow(rates, start, times, atol, breaks=(), step=np.inf):
    """A trajectory by SciPy's DOP853 at 1e-12, restarted at `breaks` : float64[n, times]."""
    y, found = np.array(start, dtype=float), np.empty((len(start), len(times)))
    edges = [times[0], *breaks, times[-1]]
    for low, high in zip(edges, edges[1:], strict=False):
        run = solve_ivp(rates, (low, high), y, "DOP853", rtol=1e-12, atol=atol, dense_output=True, max_step=step)
        inside = (times >= low) & (times <= high)
        found[:, inside], y = run.sol(times[inside]), run.y[:, -1]
    return found
