"""Acoustics of a pipe of 1 000 cells: fvsolve and its peers on the same ordinary differential equations."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
from acoustics import END, Acoustics
from measure import Solver, against, best, chart
from peers_ode import Problem, cvode, cvode_options, numbalsodas, scipy_ivp, scipy_odeint, sundae
from price import price
from stiff_cylinder import implicit_methods, reached

import fvsolve

TARGET = 1e-6
# least ratio of every peer, and of CVODE with a band matrix
GOALS = {"explicit": 7.0, "implicit": 1.0}
BEYOND = "numbalsoda DOP853"  # outside the goals: explicit, compiled, and with the same f
# upwind5 and RK4 are stable up to 1.43
COURANTS = {"rk4": (1.4, 1.2, 1.0, 0.7), "dormand-prince": (1.4, 1.0)}


def pipe_table(quick: bool) -> None:
    """Print the error of the end state, relative to the exact one of the semi-discrete equations, against wall time."""
    pulse = Acoustics(50 if quick else 1000)
    low, up = pulse.band
    print(
        f"\nA pulse in a pipe of {pulse.cells} cells, there and back; upwind5, band {low} + 1 + {up}; a call of f: ",
        end="",
    )
    print(
        f"{call_time(pulse.rhs, pulse.start.y):.2f} us, interleaved {call_time(pulse.rhs_mixed, pulse.start.y):.2f}"
    )
    budget, rounds = (0.0, 1) if quick else (0.3, 3)
    # at 1e-4 LSODA switches to full matrices
    tolerances = (1e-6,) if quick else 10.0 ** -np.arange(5.0, 10.0)
    groups = {
        "explicit": [stepped(pulse, method, "courant") for method in COURANTS],
        "implicit": [stepped(pulse, method, "rtol") for method in implicit_methods(quick)],
        "peers": pipe_peers(pulse, quick),
    }
    settings = {s.name: tolerances for group in groups.values() for s in group}
    settings |= {
        s.name: courants for s, courants in zip(groups["explicit"], COURANTS.values(), strict=True)
    }
    solvers = [s for group in groups.values() for s in group]
    charts = chart(solvers, settings, pulse.distance, budget, rounds, enough=0.3 * TARGET)
    if quick:
        reached(charts, 1e-2)
    verdict({of: {s.name: charts[s.name] for s in group} for of, group in groups.items()})


def call_time(rhs, y) -> float:
    """Wall time of one compiled call [us]."""

    @numba.njit
    def many(times, y, dydt):
        for _ in range(times):
            rhs(0.0, y, dydt)

    many(1, y, np.empty(y.size))
    return best(lambda: many(1000, y, np.empty(y.size)), 0.05) * 1e3


def stepped(pulse: Acoustics, method: str, control: str) -> Solver:
    """Solver fvsolve.advance; its setting is a Courant number or a tolerance."""
    models = {}

    def solve(setting):
        if setting not in models:
            models[setting] = pulse.build(method=method, **{control: float(setting)})
        return fvsolve.advance(models[setting], pulse.start, END).y

    return Solver(f"fvsolve {method}, {control}", solve)


def pipe_peers(pulse: Acoustics, quick: bool) -> list[Solver]:
    """Solvers on the same equations: interleaved states for solvers with a band, otherwise states in fvsolve's order.

    With `quick` one of each package.
    """
    t = np.array([0.0, 0.5 * END, END])
    straight = Problem(pulse.rhs, pulse.start.y, t)
    mixed = Problem(pulse.rhs_mixed, pulse.start.y[pulse.mixed], t, pulse.band)
    back = np.argsort(pulse.mixed)
    found = [at_end(solver, slice(None)) for solver in numbalsodas(straight, "DOP853", "LSODA")]
    banded = [scipy_ivp(mixed, "Radau")]
    if sundae:
        banded.append(cvode(mixed, "scikit-sundae CVODE, band", cvode_options(mixed)))
    if not quick:
        banded += [scipy_odeint(mixed), scipy_ivp(mixed, "BDF")]
    if sundae and not quick:
        banded.append(
            cvode(
                mixed, "scikit-sundae CVODE Adams, band", cvode_options(mixed) | {"method": "Adams"}
            )
        )
    return found + [at_end(solver, back) for solver in banded]


def at_end(solver: Solver, order) -> Solver:
    """Solver that returns the end state alone, in fvsolve's order."""
    return replace(solver, solve=lambda setting: solver.solve(setting)[-1][order])


def verdict(charts) -> None:
    """Print wall times at the end error TARGET, relative to fvsolve's best explicit and best implicit run."""
    prices = {
        name: (*price([(r.wall, r.error) for r in runs], TARGET), group)
        for group, solvers in charts.items()
        for name, runs in solvers.items()
        if runs
    }
    prices = {name: found for name, found in prices.items() if np.isfinite(found[0])}
    least = {
        of: min((cost for cost, _, g in prices.values() if g == of), default=np.nan) for of in GOALS
    }
    print(
        f"\n  end error {TARGET:.0e}: wall time, and how many times that of fvsolve's best explicit and implicit"
    )
    for name, (cost, how, group) in sorted(prices.items(), key=lambda item: item[1][0]):
        factors = {of: cost / least[of] for of in GOALS}
        said = []
        if group == "peers" and name != BEYOND:
            said.append(f"explicit, {against(GOALS['explicit'], factors['explicit'])}")
        if "band" in name:
            said.append(f"implicit, {against(GOALS['implicit'], factors['implicit'])}")
        row = f"{name:36} {how or ' '}{cost * 1e3:9.2f} ms {factors['explicit']:8.2f} {factors['implicit']:8.2f}"
        print(f"    {row}  {'; '.join(said)}")
