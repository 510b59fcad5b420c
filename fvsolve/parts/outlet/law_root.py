"""Flow to ambient by the square-root law M = sqrt(G (p - ambient)): an outlet of exponent 1/2, for valves.

M is the mass flow, G the conductance, p the upstream pressure. The flow is never negative; below 10 Pa a cubic joins
the law to zero flow.
"""

from fvsolve.jit import njit
from fvsolve.parts.outlet.law_outlet import bends, emitter_slope, emitter_step, rule_of

__all__ = ["bends", "slope", "step"]


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """(a, s) of `emitter_step` for restriction k under its present rule; arguments as for `restriction_step`."""
    return emitter_step(
        tables.floats, tables.valves[k]["data"], g * denser, m, drop, rule_of(tables, k)
    )


@njit
def slope(out, tables, k, g, drop):
    """Derivative [kg/s/Pa] of the mass flow of restriction k by its drop; g : conductance [kg2/s2/Pa], drop : [Pa]"""
    return emitter_slope(tables.floats, tables.valves[k]["data"], g, drop, rule_of(tables, k))
