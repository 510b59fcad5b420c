"""Oil with air, independent of fvsolve: density law, trajectories by SciPy, flow through the bores of an air valve."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from reference.scenes import AMBIENT, area

ATM = 101325.0


@dataclass
class AirOil:
    """Specific volume of liquid, (1 - (p - p_ref) / K) / rho per mass, with its free gas.

    The gas occupies a v_atm (p_atm / p)^(1/n) / (1 - a) per mass of liquid, with v_atm the volume of the liquid at 1
    atm.
    """

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
        """Volume of free gas over that of the liquid at the reference pressure [-].

        Pressures are limited from below, because trial steps of SciPy may leave the valid range.
        """
        x, atm, end = max(p - self.floor, 1e-3), ATM - self.floor, self.saturation - self.floor
        left = (1.0 - x / end) / (1.0 - atm / end) if x < end else 0.0
        return (
            self.fraction
            / (1.0 - self.fraction)
            * self.liquid(ATM)
            * (atm / x) ** (1.0 / self.exponent)
            * left
        )

    def density(self, p):
        return self.rho / (self.liquid(p) + self.gas(p))

    def modulus_at(self, p):
        """Effective bulk modulus -V dp/dV [Pa]: 1/K_eff = (1 - g) / K_l + g / (n p) + g / (p_sat - p)."""
        g = self.gas(p) / (self.liquid(p) + self.gas(p))
        dissolving = g / (self.saturation - p) if g > 0.0 else 0.0
        return 1.0 / (
            (1.0 - g) / (self.liquid(p) * self.modulus)
            + g / (self.exponent * (p - self.floor))
            + dissolving
        )


def orifice(area: float, up: float, down: float, oil: AirOil) -> float:
    """Mass flow through an orifice of effective area `area` [m2] at the upstream density [kg/s]."""
    return math.copysign(
        area * math.sqrt(2.0 * oil.density(max(up, down)) * abs(up - down)), up - down
    )


def follow(rates, start, times, atol, breaks=(), step=np.inf):
    """Trajectory float64[n, times] by SciPy's DOP853 with rtol 1e-12, restarted at `breaks`."""
    y, found = np.array(start, dtype=float), np.empty((len(start), len(times)))
    edges = [times[0], *breaks, times[-1]]
    for low, high in zip(edges, edges[1:], strict=False):
        run = solve_ivp(
            rates, (low, high), y, "DOP853", rtol=1e-12, atol=atol, dense_output=True, max_step=step
        )
        inside = (times >= low) & (times <= high)
        found[:, inside], y = run.sol(times[inside]), run.y[:, -1]
    return found


HEAT = 287.05 * 293.15
SMALL = (
    # relative to upstream pressure: below it an odd quintic replaces the root, with two continuous derivatives
    1e-3
)
QUINTIC = np.linalg.solve([[1, 1, 1], [1, 3, 5], [0, 6, 20]], [1.0, 0.5, -0.25])


def softened(x: float) -> float:
    """Ratio of the softened root to sqrt(x): 1 from SMALL on, the odd quintic over sqrt(x) below."""
    s = x / SMALL
    return 1.0 if s >= 1.0 else float(QUINTIC @ [s, s**3, s**5]) / math.sqrt(s) if s > 0.0 else 0.0


def bores(p: float, inlet: float, outlet: float, soft=softened) -> float:
    """Mass flow of air into a chamber at p, subsonic or choked, in or out (Wylie and Streeter 1993, 7-4) [kg/s]."""
    root = math.sqrt(HEAT)
    if p <= AMBIENT:
        size, r, sign = 0.6 * area(inlet) * AMBIENT / root, p / AMBIENT, 1.0
    else:
        size, r, sign = 0.6 * area(outlet) * p / root, AMBIENT / p, -1.0
    if r < 0.528281787717174:
        return sign * size * math.sqrt(1.4) * (2 / 2.4) ** (2.4 / 0.8)
    return sign * size * math.sqrt(7 * max(0.0, r ** (2 / 1.4) - r ** (2.4 / 1.4))) * soft(1.0 - r)
