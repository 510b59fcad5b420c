"""Friction of basins in time steps: implicit in the stages of SSP methods, or with a cap of its rate."""

import math

from fvsolve.basins.free_surface.bed_friction import RATE_CAP
from fvsolve.basins.lower_basin import BasinRows
from fvsolve.case.bodies import free_joints
from fvsolve.steppers.analysis.stability_properties import in_euler_steps
from fvsolve.steppers.tableau import AUTO, METHODS

NO_CAP = 1e100  # rate of friction [1/s] above all possible rates


class RowsWithFriction(BasinRows):
    """Basin of a model with friction that decays its flows."""

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
        return self.rubs and method is not None and in_euler_steps(method) and not is_moved_by_forces

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
