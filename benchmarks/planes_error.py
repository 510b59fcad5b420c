"""CPU time against L1 error of basins, fvsolve compared with PyClaw on three smooth fields with known solutions."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from time import process_time

import numpy as np
import planes_pyclaw as peer
from measure import against, agree
from planes_scenes import scene, square
from planes_speed import swirl_faces
from price import price
from scipy.integrate import quad_vec, solve_ivp
from scipy.interpolate import BarycentricInterpolator, CubicSpline
from scipy.special import j0

import fvsolve

SIZES = (32, 48, 64, 96, 128, 192, 256)  # cells along a side
SLOW = 1.0  # CPU time above which a run is not repeated, and no finer run follows [s]
TARGETS = (1e-2, 1e-3, 1e-4)  # L1 error over the L1 norm of the field at the start
GOAL = 4.0  # times less CPU time
GRAVITY, SPEED = 9.80665, 1000.0  # [m/s2], wave speed of fvsolve's liquid [m/s]
# durations of the swirl [s], of the hump [s], of the pulse [radii]
PERIOD, SPREAD, RADII = 1.0, 0.6, 2.0
SCHEMES = {
    "muscl, SSP-RK2": {"limiter": "monotonized-central", "courant": 0.9},
    "upwind5, RK4": {"scheme": "upwind5", "method": "rk4", "courant": 1.4},
    "weno5, SSP-RK3": {"scheme": "weno5", "method": "ssp-rk3", "courant": 0.9},
}
PEERS = {
    "classic, directions in turn, MC": lambda flux: peer.classic(flux, True),
    "classic, transverse waves, MC": lambda flux: peer.classic(flux, False),
    "classic, transverse waves, no limiter": lambda flux: peer.classic(flux, False, False),
    "SharpClaw, WENO5, SSP-RK(10, 4)": peer.sharp,
}


@dataclass(frozen=True, eq=False)
class Problem:
    """Field in a square between walls, as a basin and as a state of PyClaw; `first` and `last` : functions of x, y.

    ends : times of the end in fvsolve and in PyClaw; rest : value of PyClaw's field at rest
    usual : Courant number of fvsolve relative to other physics; water uses half because of shores, absent here
    """

    name: str
    size: float
    ends: tuple[float, float]
    first: Callable
    last: Callable
    basin: dict
    flux: str
    given: dict
    rest: float = 0.0
    usual: float = 1.0

    @functools.cache  # noqa: B019  three problems live as long as the program
    def averages(self, cells: int) -> tuple[np.ndarray, np.ndarray]:
        """Averages of first and last field over cells^2 by Gauss points : float64[cells, cells], rows by y."""
        nodes, weights = np.polynomial.legendre.leggauss(5)
        x = ((np.arange(cells)[:, None] + (nodes + 1) / 2) * self.size / cells).ravel()
        w = np.tile(weights / 2, cells)
        first, last = (
            (field(*np.meshgrid(x, x)) * np.outer(w, w))
            .reshape(cells, 5, cells, 5)
            .sum(axis=(1, 3))
            for field in (self.first, self.last)
        )
        return first, last

    def distance(self, found: np.ndarray) -> float:
        """Relative L1 error of cell averages."""
        first, last = self.averages(len(found))
        return np.abs(found - last).sum() / np.abs(first).sum()

    def by_fvsolve(self, numerics: dict, cells: int) -> tuple[float, np.ndarray]:
        """CPU time of fvsolve [s], and its field at the end."""
        numerics = numerics | {"courant": self.usual * numerics["courant"]}
        case = scene(square(cells, self.size) | self.basin, self.ends[0], **numerics)
        model = fvsolve.build(fvsolve.load(case))
        state = fvsolve.initial_state(model)
        state.y[: cells**2] = self.averages(cells)[0].ravel()
        start = process_time()
        found = fvsolve.advance(model, state, self.ends[0])
        return process_time() - start, found.y[: cells**2].reshape(cells, cells)

    def by_pyclaw(self, made: Callable, cells: int) -> tuple[float, np.ndarray]:
        """CPU time of PyClaw [s], and its field at the end."""
        solver, aux = made(self.flux), None
        q = np.zeros((peer.FIELDS.get(self.flux, 3), cells, cells))
        q[0] = self.rest + self.averages(cells)[0]
        if self.flux == "vc_advection_2D":
            aux = swirl_faces(cells, self.size)
            solver.before_step = turning(aux)
            # without a limit steps are arbitrary where the swirl is at rest
            solver.dt_max = 1.8 / cells
            if isinstance(solver, peer.pyclaw.SharpClawSolver2D):
                solver.call_before_step_each_stage = solver.aux_time_dep = True
                solver.dt_max = 2.45 / cells
        found = peer.solution(self.flux, cells, self.size, q, aux, **self.given)
        solver.dt_initial = 0.1 * self.size / cells
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            start = process_time()
            solver.evolve_to_time(found, self.ends[1])
            return process_time() - start, found.state.q[0].T - self.rest


def turning(aux: np.ndarray) -> Callable:
    """Function that turns the swirl back: classic steps use the middle of a step, stages of SharpClaw their time."""
    whole = np.asfortranarray(aux.transpose(0, 2, 1))

    def turn(solver, state) -> None:
        t = state.t + (0.5 * solver.dt if isinstance(solver, peer.pyclaw.ClawSolver2D) else 0.0)
        np.multiply(whole, np.cos(pi * t / PERIOD), out=state.aux)

    return turn


def swirl() -> Problem:
    """Smooth bump that LeVeque's swirl deforms and brings back."""

    def bump(x, y):
        return np.exp(-((x - 0.35) ** 2 + (y - 0.5) ** 2) / 0.01)

    velocity = {"expression": "swirl", "period": PERIOD}
    basin = {
        "physics": "transport",
        "velocity": velocity,
        "scalars": {"dye": "where(x < 0.5, 1, 0)"},
    }
    return Problem("swirl", 1.0, (PERIOD, PERIOD), bump, bump, basin, "vc_advection_2D", {})


def hump() -> Problem:
    """Hump of 0.2 m that spreads on water 1 m deep."""
    level = radial(SPREAD)
    return Problem(
        "hump of water",
        12.0,
        (SPREAD, SPREAD),
        lambda x, y: 0.2 * gauss(np.hypot(x - 6, y - 6)),
        lambda x, y: level(np.hypot(x - 6, y - 6)),
        {"level": 1.0},
        "shallow_roe_with_efix_2D",
        {"grav": GRAVITY},
        rest=1.0,
        usual=2.0,
    )


def pulse() -> Problem:
    """Round pulse of pressure that spreads, by Hankel's integral."""
    r = np.linspace(0.0, 9.0, 500)
    found = quad_vec(
        lambda k: k / 2 * np.exp(-k * k / 4) * np.cos(k * RADII) * j0(k * r),
        0.0,
        16.0,
        epsrel=1e-12,
    )[0]
    shape, basin = (
        CubicSpline(r, found),
        {"physics": "liquid", "pressure": 1e6, "thickness": 1.0, "wave_speed": SPEED},
    )
    return Problem(
        "pulse of pressure",
        12.0,
        (RADII / SPEED, RADII),
        lambda x, y: gauss(np.hypot(x - 6, y - 6)),
        lambda x, y: shape(np.hypot(x - 6, y - 6)),
        basin,
        "acoustics_2D",
        dict(rho=1.0, bulk=1.0, zz=1.0, cc=1.0),
    )


def gauss(r):
    """Shape of hump and pulse, exp(-r^2)."""
    return np.exp(-r * r)


def radial(end: float, points: int = 180, radius: float = 9.0) -> Callable:
    """Rise of the hump at time `end` as a function of distance: axisymmetric shallow water by Chebyshev polynomials."""
    k = np.arange(points)
    x, c = (
        np.cos(pi * k / (points - 1)),
        np.where((k == 0) | (k == points - 1), 2.0, 1.0) * (-1.0) ** k,
    )
    steps = x[:, None] - x + np.eye(points)
    d = np.outer(c, 1.0 / c) / steps
    d, r = (d - np.diag(d.sum(axis=1))) / radius, radius * x

    def slopes(t, y):
        e, q = np.split(y, 2)
        h = 1.0 + e
        flow = q * q / h
        push = -(d @ flow + flow / r + GRAVITY * h * (d @ e))
        push[[0, -1]] = 0.0  # a wall that no wave reaches
        return np.concatenate([-(d @ q + q / r), push])

    start = np.concatenate([0.2 * gauss(r), np.zeros(points)])
    found = solve_ivp(slopes, (0.0, end), start, method="DOP853", rtol=1e-10, atol=1e-12).y[
        :points, -1
    ]
    s = np.linspace(0.0, 0.99 * radius, 1000)
    return CubicSpline(s, BarycentricInterpolator(r, found)(s))


def runs(problem: Problem, solve: Callable, sizes, rounds: int) -> dict[int, tuple[float, float]]:
    """Cells along a side -> (CPU time, error), the best of some rounds, up to the finest grid that the targets need."""
    found = {}
    solve(sizes[0])  # compiles
    for cells in sizes:
        spent, field = solve(cells)
        for _ in range(rounds if spent < SLOW else 0):
            spent = min(spent, solve(cells)[0])
        found[cells] = spent, problem.distance(field)
        if spent > SLOW or found[cells][1] < 0.5 * TARGETS[-1]:
            break
    return found


def error_table(quick: bool) -> None:
    """Print CPU times and errors of every scheme, and the costs of the target errors."""
    sizes, rounds, schemes, problems = SIZES, 4, SCHEMES, (swirl, hump, pulse)
    if quick:
        sizes, rounds, schemes, problems = SIZES[:2], 1, dict(list(SCHEMES.items())[:1]), (hump,)
    for problem in (one() for one in problems):
        print(
            f"\n{problem.name}: CPU [ms], relative L1 error\n| |"
            + "".join(f" {n}^2 |" for n in sizes)
        )
        print("|---|" + "---|" * len(sizes))
        charts = {}
        solvers = {
            f"fvsolve {name}": functools.partial(problem.by_fvsolve, own)
            for name, own in schemes.items()
        }
        for name, made in PEERS.items() if peer.pyclaw else ():
            solvers[f"PyClaw {name}"] = functools.partial(problem.by_pyclaw, made)
        for name, solve in solvers.items():
            charts[name] = runs(problem, solve, sizes, rounds)
            row = "".join(
                f" {1e3 * spent:.3g}, {error:.1e} |" for spent, error in charts[name].values()
            )
            print(f"| {name} |{row}", flush=True)
            agree(
                f"least L1 error of {problem.name} by {name}",
                min(error for _, error in charts[name].values()),
                0.3,
            )
        verdict(charts)


def verdict(charts: dict) -> None:
    """Print the least costs of both programs at every target error."""
    for target in TARGETS:
        costs = {name: price(list(chart.values()), target) for name, chart in charts.items()}
        best = {
            program: min(
                (cost[0], cost[1], name) for name, cost in costs.items() if name.startswith(program)
            )
            for program in dict.fromkeys(name.split()[0] for name in charts)
        }
        said = [f"{name}: {how}{1e3 * cost:.3g} ms" for cost, how, name in best.values()]
        if len(best) == 2:
            factor = best["PyClaw"][0] / best["fvsolve"][0]
            said.append(f"{factor:.1f} times less, {against(GOAL, factor)}")
        print(f"  at {target:.0e}: " + "; ".join(said))
