"""Division of a given step where nothing but the parts of a case limits it."""

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.step_control import DIVIDED_FRACTION
from fvsolve.core.steppers.tableau import method_named


def dividing_rate(model, step: float) -> float:
    """Rate above which explicit steps of given length are divided [1/s]; 0 for steps that are never divided.

    Steps are divided beside pipes without cells, whose own waves do not limit a step: then the parts at the ends of
    pipes are all that a given step can be too long for. The rate is that of the step, and at least that of waves in the
    cells of other pipes. step : given step [s]
    """
    if model.meshed or not (model.tables.pipes["cells"] == 0).any():
        return 0.0
    return max(1.0 / step, float(model.tables.settings["rate"][0]) * (1.0 + 1e-9))


def step_at_start(model) -> float:
    """Given step of a run, or the part of it into which an explicit method divides it at the start [s]."""
    numerics, step = model.case.numerics, model.case.numerics.step
    explicit = method_named(automatic.first_method(numerics.method)).explicit
    least = dividing_rate(model, step) if explicit else 0.0
    rate = (
        float(model.evaluate(numerics.start, model.start, numerics.start)[1][rec.RATE])
        if least > 0.0
        else 0.0
    )
    return DIVIDED_FRACTION / rate if rate > least > 0.0 else step
