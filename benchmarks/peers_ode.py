"""Solvers of y' = f(t, y) in numbalsoda, scikit-sundae and SciPy, each in its fastest form from Python.

Every solver has the same compiled f(t, y, dydt) and one tolerance, relative and absolute.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numba
import numpy as np
from measure import Solver, peer_module
from numba import types
from pointer import pointer
from scipy import sparse
from scipy.integrate import odeint, solve_ivp

numbalsoda, sundae = (
    peer_module("numbalsoda", "numbalsoda"),
    peer_module("sksundae.cvode", "scikit-sundae"),
)
MANY = 10**8  # greatest number of steps between two times


@dataclass(frozen=True, eq=False)
class Problem:
    """Initial value problem y' = f(t, y) from y0 at t[0], with results at the times t.

    rhs : compiled f(t, y, dydt); band : (lower, upper) bandwidth of df/dy, or None if it is full
    """

    rhs: Callable
    y0: np.ndarray
    t: np.ndarray
    band: tuple[int, int] | None = None


def peers(problem: Problem, quick: bool) -> list[Solver]:
    """Solvers for stiff problems, with `quick` one of each package."""
    if quick:
        return [*numbalsodas(problem, "LSODA"), *cvodes(problem)[:1], scipy_ivp(problem, "Radau")]
    found = [*numbalsodas(problem, "LSODA"), *cvodes(problem)]
    return (
        found
        + [scipy_ivp(problem, name) for name in ("Radau", "BDF", "LSODA")]
        + [scipy_odeint(problem)]
    )


# numbalsoda ---------------------------------------------------------------------------------------------------


def address(problem: Problem):
    """C function of f for numbalsoda, which counts its calls in data[0]."""
    rhs, n = problem.rhs, problem.y0.size

    def function(t, u, du, data):
        data[0] += 1.0
        rhs(t, numba.carray(u, (n,)), numba.carray(du, (n,)))

    return numba.cfunc(numbalsoda.lsoda_sig)(function)


def numbalsodas(problem: Problem, *names: str) -> list[Solver]:
    """LSODA (C++, full matrices only) and DOP853 (Fortran) of numbalsoda, if installed, with compiled f."""
    return [numba_solver(problem, name) for name in names] if numbalsoda else []


def numba_solver(problem: Problem, name: str) -> Solver:
    """Solver of numbalsoda by its name."""
    function, run = address(problem), getattr(numbalsoda, name.lower())
    counter = np.zeros(1)

    def solve(tolerance):
        counter[0] = 0.0
        y, well = run(function.address, problem.y0, problem.t, counter, tolerance, tolerance, MANY)
        return y if well else np.full_like(y, np.nan)

    def count(tolerance):
        solve(tolerance)
        return np.nan, counter[0]

    return Solver(f"numbalsoda {name}", solve, count)


def explicit_reference(problem: Problem, tolerance: float = 1e-13) -> np.ndarray:
    """Solution y at all times by DOP853 of numbalsoda, or of SciPy if numbalsoda is not installed."""
    solver = scipy_ivp(problem, "DOP853") if numbalsoda is None else numba_solver(problem, "DOP853")
    return solver.solve(tolerance)


# scikit-sundae ------------------------------------------------------------------------------------------------

READ = types.Array(types.float64, 1, "C", readonly=True)
WRITE = types.float64[::1]


def cvodes(problem: Problem) -> list[Solver]:
    """CVODE's BDF, if installed, with df/dy by its own differences and by compiled ones."""
    if sundae is None:
        return []
    own = cvode_options(problem)
    other = own | {"jacfn": differences(problem)}
    return [
        cvode(problem, "scikit-sundae CVODE", own),
        cvode(problem, "scikit-sundae CVODE, compiled df/dy", other),
    ]


def cvode_options(problem: Problem) -> dict:
    """Options of BDF with a dense matrix, or with a band if the problem has one."""
    if problem.band is None:
        return {"method": "BDF", "linsolver": "dense"}
    return {
        "method": "BDF",
        "linsolver": "band",
        "lband": problem.band[0],
        "uband": problem.band[1],
    }


def cvode(problem: Problem, name: str, options: dict) -> Solver:
    """Solver CVODE with a compiled f."""
    rhs = problem.rhs

    @numba.njit(types.void(types.float64, READ, WRITE), error_model="numpy")
    def function(t, y, yp):  # CVODE passes a read-only y, which has another type in numba
        rhs(t, numba.carray(pointer(y.ctypes.data), y.size, np.float64), yp)

    def solver(tolerance):
        return sundae.CVODE(function, rtol=tolerance, atol=tolerance, max_num_steps=MANY, **options)

    def solve(tolerance):
        return solver(tolerance).solve(problem.t, problem.y0).y

    def count(tolerance):
        steps = solver(tolerance).solve(problem.t[[0, -1]], problem.y0).t.size - 1
        return steps, solver(tolerance).solve(problem.t, problem.y0).nfev

    return Solver(name, solve, count)


def differences(problem: Problem):
    """Jacobian df/dy : float64[n, n] by one-sided differences, compiled, with the arguments of CVODE."""
    rhs = problem.rhs

    @numba.njit(types.void(types.float64, READ, READ, types.float64[:, :]), error_model="numpy")
    def jacobian(t, y, yp, found):
        moved, rate = np.empty(y.size), np.empty(y.size)
        for i in range(y.size):
            moved[i] = y[i]
        for j in range(y.size):
            moved[j] = y[j] + 1.5e-8 * max(abs(y[j]), 1e-3)
            rhs(t, moved, rate)
            for i in range(y.size):
                found[i, j] = (rate[i] - yp[i]) / (moved[j] - y[j])
            moved[j] = y[j]

    return jacobian


# SciPy --------------------------------------------------------------------------------------------------------


def returning(problem: Problem):
    """Compiled function that returns dydt = f(t, y)."""
    rhs = problem.rhs

    @numba.njit(error_model="numpy")
    def function(t, y):
        dydt = np.empty(y.size)
        rhs(t, y, dydt)
        return dydt

    return function


def scipy_ivp(problem: Problem, method: str) -> Solver:
    """Solver solve_ivp with a compiled f and, if the problem has a band, its pattern."""
    function = returning(problem)
    options = {}
    if problem.band and method == "LSODA":
        options = {"lband": problem.band[0], "uband": problem.band[1]}
    elif problem.band and method in ("Radau", "BDF"):
        n, (low, up) = problem.y0.size, problem.band
        options = {
            "jac_sparsity": sparse.diags(
                [np.ones(n)] * (low + up + 1), range(-low, up + 1), shape=(n, n)
            )
        }
    span = problem.t[[0, -1]]
    run = partial(solve_ivp, function, span, problem.y0, method, **options)

    def solve(tolerance):
        return run(t_eval=problem.t, rtol=tolerance, atol=tolerance).y.T

    def count(tolerance):
        found = run(rtol=tolerance, atol=tolerance)
        return found.t.size - 1, found.nfev

    return Solver(f"SciPy {method}", solve, count)


def scipy_odeint(problem: Problem) -> Solver:
    """Solver LSODA by odeint, without solve_ivp's Python code between steps."""
    options = {"ml": problem.band[0], "mu": problem.band[1]} if problem.band else {}
    run = partial(
        odeint, returning(problem), problem.y0, problem.t, tfirst=True, mxstep=10**6, **options
    )

    def solve(tolerance):
        return run(rtol=tolerance, atol=tolerance)

    def count(tolerance):
        numbers = run(rtol=tolerance, atol=tolerance, full_output=True)[1]
        return numbers["nst"][-1], numbers["nfe"][-1]

    return Solver("SciPy odeint (LSODA)", solve, count)
