"""Forces of the fluid on pipe legs between bends and dead ends.

The force is the rate of momentum loss of the fluid, - d/dt of the integral of M dx [N], with mass flow M. It acts on
ends and wall in addition to the initial steady force; positive from `from` to `to`.
"""

from fvsolve.core.kernels.barotropic_pipes import rates_barotropic
from fvsolve.core.kernels.cavitating_pipes import rates_cavitating
from fvsolve.core.kernels.dtypes import PIPE_FORCE
from fvsolve.core.kernels.pipes import wave_rates
from fvsolve.core.kernels.relaxation import add_unsteady_friction, add_unsteady_friction_barotropic
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit, specialise


@njit
def read_forces(dydt, tables, values):
    """Write the force of the fluid on the pipe [N] for every force probe: - sum over cells of dM/dt dx, mass flow M.

    dydt : d/dt of the states, which contains that of the waves in cells
    """
    for k in range(tables.probes.size):
        probe = tables.probes[k]
        if probe["kind"] == PIPE_FORCE:
            pipe, total = tables.pipes[probe["index"]], 0.0
            n, o = pipe["cells"], pipe["y"]
            for i in range(n):
                total += dydt[o + i] - dydt[o + n + i]
            # A force of zero must not become a negative zero.
            values[k] = (0.0 - total) * pipe["dx"]


RATES = FRICTION = None  # constants of the template


def _observe_forces(t, y, out, handle, values):
    """Write the forces of the fluid on pipes [N] to `values`."""
    tables = open_tables(handle)
    at = tables.layout[0]["forces"]
    dydt = tables.work[at : at + y.size]
    # A state that is observed has no rates, so they are computed here, in a work array.
    RATES(t, y, dydt, out, handle)
    FRICTION(t, y, dydt, out, handle)
    read_forces(dydt, tables, values)


observe_forces_linear = specialise(
    _observe_forces, "observe_forces_linear", RATES=wave_rates, FRICTION=add_unsteady_friction
)
observe_forces_barotropic = specialise(
    _observe_forces,
    "observe_forces_barotropic",
    RATES=rates_barotropic,
    FRICTION=add_unsteady_friction_barotropic,
)
observe_forces_cavitating = specialise(
    _observe_forces,
    "observe_forces_cavitating",
    RATES=rates_cavitating,
    FRICTION=add_unsteady_friction_barotropic,
)
