"""Of what opens to ambient by the root M = sqrt(G (p - ambient)): an outlet's law of exponent 1/2. Knows one of these.

Nothing comes back, and below 10 Pa a cubic leads to no flow.
"""

from fvsolve.jit import njit
from fvsolve.parts.outlet.law import bends, emitter_slope, emitter_step, rule_of

__all__ = ["bends", "slope", "step"]


@njit
def step(out, tables, k, g, m, drop, denser, wide):
    """a, s of its flow under the rule that holds."""
    return emitter_step(tables.floats, tables.valves[k]["data"], g * denser, m, drop, rule_of(tables, k))


@njit
def slope(out, tables, k, g, drop):
    """d flow / d drop [kg/s/Pa]."""
    return emitter_slope(tables.floats, tables.valves[k]["data"], g, drop, rule_of(tables, k))
