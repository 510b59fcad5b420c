"""Equal pumps in parallel: a pump with the flow, the power and the inertia of all, and a single pump of them."""

from dataclasses import replace
from typing import Any

from fvsolve.parts.pump.head_curve import CurvePoints
from fvsolve.parts.pump.part import Pump


def combined_pump(pump: Pump) -> Pump:
    """Pump equal to all `count` pumps of a part; it keeps `count`, by which its specific speed and inertia are known.

    At a head it has `count` times the flow [m3/s], the power [W] and the inertia [kg m2] of each pump.
    """
    n = pump.count
    if n == 1:
        return pump
    suter = pump.suter
    return pump.model_copy(
        update={
            "curve": with_flows(pump.curve, n),
            "power": None if pump.power is None else n * pump.power,
            "suter": None if suter is None else replace(suter, rated_flow=n * suter.rated_flow),
            "inertia": None if pump.inertia is None else n * pump.inertia,
            "efficiency": with_flows(pump.efficiency, n),
            "shaft_power": with_flows(pump.shaft_power, n, n),
            "overall_efficiency": with_flows(pump.overall_efficiency, n),
        }
    )


def single_pump(pump: Pump) -> Pump:
    """Pump equal to each of the pumps of a part."""
    return pump if pump.count == 1 else pump.model_copy(update={"count": 1})


def with_flows(curve: Any, factor: int, of_values: int = 1) -> Any:
    """Curve with its flows times `factor` and its values times `of_values`; a number or None is returned unchanged."""
    if not isinstance(curve, CurvePoints):
        return curve
    return replace(
        curve,
        flow=tuple(factor * flow for flow in curve.flow),
        value=tuple(of_values * value for value in curve.value),
        coefficients=tuple(c / factor**k for k, c in enumerate(curve.coefficients)),
    )
