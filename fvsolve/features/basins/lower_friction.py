"""Friction of basins in time steps: implicit in the stages of SSP methods, or with a cap of its rate."""

import math

import numpy as np

from fvsolve.case.bodies import free_joints
from fvsolve.core.steppers.analysis.stability_properties import in_euler_steps
from fvsolve.core.steppers.tableau import AUTO, METHODS
from fvsolve.errors import Notice
from fvsolve.features.basins.free_surface.bed_friction import RATE_CAP
from fvsolve.features.basins.lower_basin import BasinRows

DRY_DEPTH = 1e-4  # depth [m] of films below which water is ignored
FILM_ERROR = 0.005  # relative error of the speed of films above which there is a notice
REPEAT_FACTOR = 1.2  # factor on the error at the start above which a run gives another notice
NO_CAP = 1e100  # rate of friction [1/s] above all possible rates


class RowsWithFriction(BasinRows):
    """Basin of a model with friction that decays its flows."""

    table = "nodes"  # of the case that declares it

    @property
    def rubs(self) -> bool:
        """True if the bed has friction."""
        return self.part.physics_type.has_friction(self.part)

    @property
    def damped(self) -> bool:
        """True if the rates of Runge-Kutta stages are divided by 1 + h R for bed friction, see `damp_flows`.

        This is the case for SSP methods, unless forces move the body that carries the basin.
        """
        method, on = METHODS.get(self.case.numerics.method), self.part.on
        is_moved_by_forces = on is not None and any(free_joints(on, self.case.nodes))
        return (
            self.rubs and method is not None and in_euler_steps(method) and not is_moved_by_forces
        )

    @property
    def has_rate_cap(self) -> bool:
        """True if the decay rate of flows by friction is capped at RATE_CAP, so that explicit steps can follow it."""
        method = METHODS.get(self.case.numerics.method)
        return self.rubs and method is not None and method.explicit and not self.damped

    @property
    def rate_cap(self) -> float:
        """Cap of the decay rate of flows by friction [1/s]; without a cap inf, or NO_CAP with the method `auto`.

        A finite cap also makes friction limit the time step.
        """
        if self.has_rate_cap:
            return RATE_CAP
        return NO_CAP if self.case.numerics.method == AUTO else math.inf

    def friction_in_cells(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(depth [m], flow through cells as weight, decay rate of the flow by friction [1/s]) at deviations y."""
        raise NotImplementedError


class ErrorWatch:
    """Greatest error of one kind in a basin during a run.

    by(basin, y) : function for the error and two related values at deviations y
    notice(basin, values, when) : function for the notice of these three values; when : text of the time
    least : error up to which no notice is given
    greatest : float64[4]  time [s], error and both related values at the greatest error; nan before any error
    """

    def __init__(self, basin, by, notice, least: float) -> None:
        self.basin, self.by, self.notice, self.least, self.greatest = (
            basin,
            by,
            notice,
            least,
            np.full(4, np.nan),
        )

    def check(self, t: float, y: np.ndarray) -> None:
        """Update the greatest error with the error of a state y of the model at time t [s]."""
        error = self.by(self.basin, self.basin.deviations(y))
        if error[0] > 0.0 and not error[0] <= self.greatest[1]:
            self.greatest[:] = t, *error

    def notices(self) -> list[Notice]:
        """List with the notice of the greatest error; empty if this error is not above `least`."""
        t, *error = self.greatest.tolist()
        if not error[0] > self.least:
            return []
        return [self.notice(self.basin, error, f" at {self.basin.case.moment(t, 4)}")]


def fast_film_error(basin, y: np.ndarray) -> tuple[float, float, float]:
    """Mean error of films that are too fast at deviations y, as three numbers; (0, nan, nan) without flow.

    They are speed / correct speed - 1, depth [m], and decay rate of the flow by friction [1/s], all averaged with the
    flow through cells as weight. If friction at the rate r = C u balances a slope and is capped as
    r / (1 + r / RATE_CAP), then u^2 is too great by the factor 1 + r / RATE_CAP.
    """
    depth, flow, rate = basin.friction_in_cells(y)
    flow = np.where(depth > DRY_DEPTH, flow, 0.0)
    if not flow.any():
        return 0.0, math.nan, math.nan
    error = np.sqrt(1.0 + rate / RATE_CAP) - 1.0
    return tuple(float(np.average(values, weights=flow)) for values in (error, depth, rate))


def fast_film_notice(basin, error: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that films are too fast. error : result of `fast_film_error`; when : text of the time"""
    remedy = (
        'method = "rodas-5p"' if basin.part.on is not None else 'method = "ssp-rk3" or "ssp-rk2"'
    )
    deep, method = basin.case.amount(error[1], "length", 3), basin.case.numerics.method
    text = (
        f"{basin.name}: water runs {100.0 * error[0]:.2g} % too fast{when}: with {method} the decay rate by friction, "
        f"{error[2]:.2g} 1/s in {deep} of water, is capped below {RATE_CAP:g} 1/s; "
        f"use {remedy}, where the rate has no cap"
    )
    return Notice("friction", f"{basin.table}.{basin.name}", text, "method", error[0], FILM_ERROR)


def cap_checks(basin) -> list[tuple]:
    """(function for the error, function for its notice) of the cap of friction, empty for a basin without a cap."""
    return [(fast_film_error, fast_film_notice)] if basin.has_rate_cap else []


def start_notices(basin, y: np.ndarray, checks: list[tuple]) -> list[Notice]:
    """Notices of pairs such as `cap_checks` whose errors at deviations y are above FILM_ERROR."""
    return [
        notice(basin, error) for look, notice in checks if (error := look(basin, y))[0] > FILM_ERROR
    ]


def run_checks(basin, y: np.ndarray, checks: list[tuple]) -> list[ErrorWatch]:
    """Checks of a run by pairs such as `cap_checks`, of errors above FILM_ERROR and REPEAT_FACTOR times that at y."""
    least = [max(FILM_ERROR, REPEAT_FACTOR * look(basin, y)[0]) for look, _ in checks]
    return [ErrorWatch(basin, *pair, error) for pair, error in zip(checks, least, strict=True)]
