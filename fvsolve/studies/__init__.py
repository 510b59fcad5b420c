"""Studies of a case by many runs: order of convergence, accuracy against cost, stability, energy, sizing, sweeps."""

from fvsolve.lazy_exports import lazy_names

_HOMES = {  # public name -> module of this package
    "LineImpedance": "ports.line_impedance",
    "Linear": "linearise",
    "Loop": "loops.loop",
    "Transfer": "ports.response",
    "advection_limit": ".step_limits.advection_limit",
    "advection_limits": ".step_limits.advection_limit",
    "calibrate": "calibrate",
    "chart": "accuracy.chart",
    "optimise": "closure_optimisation",
    "energy": "energy_balance",
    "failure_map": "failure_map",
    "fit": "accuracy.fit",
    "input_response": "loops.input_response",
    "ladder": "accuracy.model_hierarchy",
    "limit_of": ".step_limits.advection_limit",
    "limited_limits": "stability.periodic_limits",
    "line_positive_real": "ports.line_impedance",
    "linearise": "linearise",
    "loop": "loops.loop",
    "measured_limits": "stability.periodic_limits",
    "order": "accuracy.order",
    "passivity": "passivity",
    "positive_real": "ports.positive_real",
    "response": "ports.response",
    "sensitivity": "sensitivity",
    "size": "sizing",
    "stability": "stability.stability",
    "study": "scenarios",
    "state_positive_real": "ports.response",
    "sweep": "sweep",
    "sweep_positive_real": "ports.line_impedance",
    "water_quality": "water_quality.water_quality",
}

__all__ = lazy_names(__name__, _HOMES)  # noqa: PLE0605
