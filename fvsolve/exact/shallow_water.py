"""Exact solutions of the shallow-water equations along x: steady flows over beds, dam breaks, a swinging parabola.

Those without another source are from Delestre et al. 2013, SWASHES, Int. J. Numer. Meth. Fluids 72:269, whose data are
the defaults. Each solution is a function of x [m] and t [s], and of its data. It returns depth, velocity and bed, nan
where the solution is unknown.
"""

import inspect
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

GRAVITY = 9.80665  # m/s2


class Flow(NamedTuple):
    """Depth [m], velocity [m/s] and bed [m] at places : float64[n] each."""

    depth: np.ndarray
    u: np.ndarray
    bed: np.ndarray

    @property
    def surface(self) -> np.ndarray:
        """Surface [m]; of the bed where it is dry."""
        return self.depth + self.bed

    @property
    def discharge(self) -> np.ndarray:
        """Flow per width [m2/s]."""
        return self.depth * self.u


SOLUTIONS: dict[str, Callable[..., Flow]] = {}


def solution(function: Callable[..., Flow]) -> Callable[..., Flow]:
    """Decorator: adds a solution under its name with hyphens."""
    SOLUTIONS[function.__name__.replace("_", "-")] = function
    return function


def data_of(name: str) -> dict[str, float]:
    """Names and defaults of the data of a solution."""
    keys = inspect.signature(SOLUTIONS[name]).parameters
    return {key: item.default for key, item in keys.items() if key not in ("x", "t")}


def parabolic_bump(x: np.ndarray) -> np.ndarray:
    """Bed of 0.2 m between 8 and 12 m [m]."""
    return np.maximum(0.0, 0.2 - 0.05 * (x - 10.0) ** 2)


@solution
def bump(x, t, flow: float = 4.42, level: float = 2.0, transcritical: float = 0.0) -> Flow:
    """Steady flow over the bump: subcritical, critical at the crest (`transcritical` 1), or with a jump behind it (2).

    The head q^2 / (2 g h^2) + h + z is constant on each side of the jump; the jump keeps q^2 / h + g h^2 / 2.
    flow : per width [m2/s]; level : depth at the outlet [m], without effect for 1
    """
    bed, critical = parabolic_bump(x), (flow**2 / GRAVITY) ** (1.0 / 3.0)
    top = 1.5 * critical + 0.2
    outlet = flow**2 / (2.0 * GRAVITY * level**2) + level
    if transcritical == 0.0:
        return Flow(h := depths(flow, outlet - bed, True), flow / h, bed)
    before, after = depths(flow, top - bed, True), depths(flow, top - bed, False)
    h = np.where(x <= 10.0, before, after)
    if transcritical == 2.0:
        # from here on the head of the outlet is enough to pass
        first = 10.0 + np.sqrt((top - outlet) / 0.05)
        at = brentq(jump_imbalance, first + 1e-9, 12.0, args=(flow, top, outlet))
        h = np.where(x < at, h, depths(flow, outlet - bed, True))
    return Flow(h, flow / h, bed)


def jump_imbalance(x: float, flow: float, top: float, outlet: float) -> float:
    """Difference of the momentum fluxes before and behind a jump at x [m3/s2]; top, outlet : heads on its sides [m]"""
    bed = parabolic_bump(np.array([x]))
    first, then = depths(flow, top - bed, False)[0], depths(flow, outlet - bed, True)[0]
    return flow**2 / first + GRAVITY * first**2 / 2 - flow**2 / then - GRAVITY * then**2 / 2


def depths(flow: float, energy: np.ndarray, subcritical: bool) -> np.ndarray:
    """Depths [m] of a flow per width [m2/s] with specific energies [m] : float64[n].

    They are roots of h^3 - E h^2 + q^2 / (2 g) = 0, in closed form: the greatest, or the second.
    """
    k = flow**2 / (2.0 * GRAVITY)
    angle = np.arccos(np.clip(1.0 - 13.5 * k / energy**3, -1.0, 1.0)) / 3.0
    return energy / 3.0 * (1.0 + 2.0 * np.cos(angle if subcritical else angle - 2.0 * np.pi / 3.0))


@solution
def macdonald(
    x, t, flow: float = 2.0, manning: float = 0.0, factor: float = 0.0, supercritical: float = 0.0
) -> Flow:
    """Steady flow in a channel of 1 km with friction, whose bed is made for a given depth (MacDonald 1997).

    h = (4 / g)^(1/3) (1 + exp(-16 (x/L - 1/2)^2) / 2), or (1 - exp(-36 (x/L - 1/2)^2) / 5) if `supercritical` is 1;
    dz/dx = (q^2 / (g h^3) - 1) dh/dx - n^2 q^2 / h^(10/3) - f q^2 / (8 g h^3).
    """
    size, rate = (-0.2, 36.0) if supercritical else (0.5, 16.0)

    def depth(s):
        return (4.0 / GRAVITY) ** (1.0 / 3.0) * (
            1.0 + size * np.exp(-rate * (s / 1000.0 - 0.5) ** 2)
        )

    def slope(s, _):
        h, bell = depth(s), size * np.exp(-rate * (s / 1000.0 - 0.5) ** 2)
        rise = (4.0 / GRAVITY) ** (1.0 / 3.0) * bell * -2.0 * rate * (s / 1000.0 - 0.5) / 1000.0
        friction = manning**2 * flow**2 / h ** (10.0 / 3.0) + factor * flow**2 / (
            8.0 * GRAVITY * h**3
        )
        return (flow**2 / (GRAVITY * h**3) - 1.0) * rise - friction

    line = np.linspace(0.0, 1000.0, 4001)
    fall = solve_ivp(
        slope, (0.0, 1000.0), [0.0], t_eval=line, rtol=1e-10, atol=1e-12, max_step=5.0
    ).y[0]
    return Flow(h := depth(x), flow / h, np.interp(x, line, fall - fall[-1]))


@solution
def dam_break(x, t, left: float = 0.005, right: float = 0.001, dam: float = 5.0) -> Flow:
    """Dam break over a flat bed, wet (Stoker 1957) or dry (Ritter 1892).

    left, right : depths [m], the left one is greater; dam : its place [m]
    """
    c = np.sqrt(GRAVITY * left)
    if t <= 0.0:
        return Flow(np.where(x < dam, left, right), np.zeros_like(x), np.zeros_like(x))
    ray = (x - dam) / t
    fan = np.clip((2.0 * c - ray) / 3.0, 0.0, c)
    h, u = fan**2 / GRAVITY, 2.0 * (c - fan)
    if right > 0.0:
        middle = brentq(
            lambda d: 2.0 * (c - np.sqrt(GRAVITY * d)) - behind_bore(d, right),
            right,
            left,
            xtol=1e-15,
        )
        speed = 2.0 * (c - np.sqrt(GRAVITY * middle))
        front = middle * speed / (middle - right)
        h, u = np.where(h < middle, middle, h), np.where(h < middle, speed, u)
        h, u = np.where(ray > front, right, h), np.where(ray > front, 0.0, u)
    else:
        u = np.where(h > 0.0, u, 0.0)
    return Flow(h, u, np.zeros_like(x))


def behind_bore(depth: float, ahead: float) -> float:
    """Velocity [m/s] of water of a depth [m] behind a bore that runs into still water [m]."""
    return (depth - ahead) * np.sqrt(GRAVITY * (depth + ahead) / (2.0 * depth * ahead))


@solution
def dressler(x, t, left: float = 6.0, dam: float = 1000.0, chezy: float = 40.0) -> Flow:
    """Dam break over a dry bed with friction, to first order in g / C^2 (Dressler 1952); chezy : C [m^(1/2)/s]

    Beyond the place of the greatest velocity, in the tip, the expansion is not valid, and the values are nan. It leaves
    out terms of second order in the friction.
    """
    c, bed = np.sqrt(GRAVITY * left), np.zeros_like(x)
    if t <= 0.0:
        return Flow(np.where(x < dam, left, 0.0), bed, bed)

    def corrected(place):
        ray = (place - dam) / (t * c)
        gap = np.maximum(2.0 - ray, 1e-9)
        first = 6.0 / (5.0 * gap) - 2.0 / 3.0 + 4.0 * np.sqrt(3.0) / 135.0 * gap**1.5
        second = (
            12.0 / gap - 8.0 / 3.0 + 8.0 * np.sqrt(3.0) / 189.0 * gap**1.5 - 108.0 / (7.0 * gap**2)
        )
        weight = GRAVITY**2 / chezy**2 * t
        depth = (
            np.maximum(2.0 / 3.0 * c - (place - dam) / (3.0 * t) + weight * first, 0.0) ** 2
            / GRAVITY
        )
        return depth, 2.0 / 3.0 * c + 2.0 * (place - dam) / (3.0 * t) + weight * second

    h, u = corrected(x)
    line = np.linspace(dam - t * c, dam + 2.0 * t * c, 20001)
    speeds = corrected(line)[1]
    tip = line[int(np.argmax(speeds))]
    h, u = np.where(x < dam - t * c, left, h), np.where(x < dam - t * c, 0.0, u)
    return Flow(np.where(x > tip, np.nan, h), np.where(x > tip, np.nan, u), bed)


@solution
def parabola(x, t, radius: float = 1.0, depth: float = 0.5, centre: float = 2.0) -> Flow:
    """Plane surface that swings in a parabolic channel (Thacker 1981): z = h0 ((x - L/2)^2 / a^2 - 1).

    radius : a [m]; depth : h0 [m]; centre : L/2 [m]. The velocity is uniform, B sin(w t), w = sqrt(2 g h0) / a,
    B = sqrt(2 g h0) / 2; at t = 0 the shores are half a radius from where they are at rest.
    """
    speed = np.sqrt(2.0 * GRAVITY * depth)
    swing = 0.5 * np.cos(speed * t / radius)
    h = np.maximum(0.0, -depth * (((x - centre) / radius + swing) ** 2 - 1.0))
    u = np.where(h > 0.0, 0.5 * speed * np.sin(speed * t / radius), 0.0)
    return Flow(h, u, depth * (((x - centre) / radius) ** 2 - 1.0))
