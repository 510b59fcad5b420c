"""Tables of a case file for the types of parts that EPANET has."""

import math
from typing import Any

Part = dict[str, Any]

# loss coefficient of an open valve without loss in EPANET: a case needs a positive one
NO_LOSS = 1e-4
OPENING = 0.3  # of a regulating valve that acts, at the start of a run with waves
# loss coefficient of an open control valve (globe), for valves that are shut at the start
CONTROL_VALVE_LOSS = 10.0
TIME_CONSTANT = "5 s"  # of regulating valves in a run with waves: EPANET has none
REGULATING = {"PRV": "pressure-reducing", "PSV": "pressure-sustaining", "FCV": "flow-control"}
POUND_FORCE, FOOT = 4.4482216152605, 0.3048  # [N], [m]
# EPANET's weight of water, by its power of a pump [N/m3]
WEIGHT = 550.0 / 8.814 * POUND_FORCE / FOOT**3
LEAST_EFFICIENCY = 0.01  # of pumps, as in EPANET
GRAVITY = 32.2 * FOOT  # of EPANET, in minor losses and Darcy-Weisbach [m/s2]
DENSITY = WEIGHT / GRAVITY  # of water [kg/m3]
WATER_VISCOSITY = 1.1e-5 * FOOT**2  # of EPANET, relative to which a file states a viscosity [m2/s]
AMBIENT = 101325.0  # ambient pressure of a case [Pa]
ROUNDING = 1e-9  # loss of a curve at no flow that counts as none, over its last loss
FAST = 5.0  # velocity in a PBV at the second point of its constant loss [m/s]
MINOR_LOSS = 0.02517 / FOOT  # head loss over K Q^2 / d^4, of EPANET [s2/m]
LEAST_SPAN = 0.01  # range of flows of points of a square law that no flow reaches, over the least
# error of lines between points of a square law [m]; number of points at most
LINE_ERROR, MOST_POINTS = 5e-4, 200


def quantity_text(value: float, unit: str) -> str:
    """Text of a value [SI] in a unit, with ten digits, such as `304.8 mm`."""
    factor = {"m": 1.0, "mm": 1e3, "l/s": 1e3, "m/s": 1.0, "m2": 1.0}[unit]
    return f"{value * factor:.10g} {unit}".replace("-0 ", "0 ")


def rounded_number(value: float) -> float | int:
    """Number rounded to ten digits; an integer if it is whole."""
    short = float(f"{value:.10g}")
    return int(short) if short.is_integer() else short


def junction(elevation: float, demand: float, position: Any) -> Part:
    """Table of a junction with elevation [m] and demand [m3/s]; position : coordinates x and y, or None"""
    part = {"type": "junction", "elevation": quantity_text(elevation, "m")}
    if demand:
        part["demand"] = quantity_text(demand, "l/s")
    return part | _position(position)


def pressure_demand(minimum: float, required: float, exponent: float) -> Part:
    """Keys of a demand that depends on pressure: zero up to the pressure `minimum`, full from `required` on.

    Both pressures are heads of water [m].
    Between them the demand grows with the power `exponent` of the head above `minimum`.
    """
    part = {"required_pressure": gauge_pressure(required)}
    if minimum:
        part["minimum_pressure"] = gauge_pressure(minimum)
    return part if exponent == 0.5 else part | {"demand_exponent": rounded_number(exponent)}


def gauge_pressure(head: float) -> str:
    """Text of the gauge pressure under a head of water [m]."""
    return f"{WEIGHT * head * 1e-5:.10g} barg"


def reservoir(head: float, position: Any) -> Part:
    """Table of a reservoir of given head [m]; position : coordinates x and y, or None"""
    return {"type": "reservoir", "head": quantity_text(head, "m")} | _position(position)


def tank(elevation: float, area: float, level: float, height: float, position: Any) -> Part:
    """Table of a tank with the elevation of its bottom [m] and its area [m2]; position : coordinates x and y, or None

    level, height : water level at the start and greatest water level, above the bottom [m]
    """
    part = {
        "type": "tank",
        "elevation": quantity_text(elevation, "m"),
        "area": quantity_text(area, "m2"),
    }
    part |= {"level": quantity_text(level, "m"), "height": quantity_text(height, "m")}
    return part | _position(position)


def pipe(
    ends: tuple[str, str],
    length: float,
    diameter: float,
    friction: Part,
    minor: float,
    speed: float,
) -> Part:
    """Table of a pipe with length [m], diameter [m] and its table of friction.

    ends : names of the nodes `from` and `to`; minor : minor loss coefficient; speed : wave speed [m/s]
    """
    part = _link("pipe", ends) | {
        "length": quantity_text(length, "m"),
        "diameter": quantity_text(diameter, "mm"),
    }
    part |= {"friction": friction}
    if minor:
        part["minor_loss"] = rounded_number(minor)
    return part | {"wave_speed": quantity_text(speed, "m/s")}


def manning_share(diameter: float) -> float:
    """Coefficient n of a case over that of EPANET for the same loss.

    The loss is L (4 n Q / (1.49 pi D^2))^2 / (D / 4)^1.333 in feet and cfs (EPANET 2.2, `hydcoeffs.c`); a case has
    1 for 1.49, 4/3 for 1.333, and SI. diameter : [m]
    """
    return FOOT ** (0.5 * 1.333 - 1.0) / 1.49 * (0.25 * diameter) ** (2.0 / 3.0 - 0.5 * 1.333)


def friction(formula: str, roughness: float, diameter: float) -> Part:
    """Table of friction of a pipe with a diameter [m] by a formula of EPANET: "H-W", "C-M" or "D-W".

    roughness : coefficient C [-] for "H-W", coefficient n [s/m^(1/3)] for "C-M", or roughness height [m] for "D-W"
    """
    if formula == "H-W":
        return {"model": "hazen-williams", "coefficient": rounded_number(roughness)}
    if formula == "C-M":
        return {
            "model": "chezy-manning",
            "coefficient": rounded_number(roughness * manning_share(diameter)),
        }
    return {"model": "swamee-jain", "roughness": quantity_text(roughness, "mm")}


def darcy(factor: float) -> Part:
    """Table of friction by a constant Darcy factor."""
    return {"model": "steady", "factor": rounded_number(factor)}


def valve(ends: tuple[str, str], diameter: float, loss: float, opening: float = 1.0) -> Part:
    """Table of a valve with diameter [m] and opening; ends : names of the nodes `from` and `to`

    loss : loss coefficient at full opening, for the velocity in the diameter; 0 is replaced by `NO_LOSS`
    """
    part = _link("valve", ends) | {"diameter": quantity_text(diameter, "mm")}
    part["loss_coefficient"] = rounded_number(loss or NO_LOSS)
    return part if opening == 1.0 else part | {"opening": opening}


def loss_curve(ends: tuple[str, str], points: list[tuple[float, float]]) -> Part:
    """Table of a link whose head loss follows points of flow [m3/s] and loss [m]."""
    flow, loss = zip(*points, strict=True)
    keys = {
        "flow": [quantity_text(q, "l/s") for q in flow],
        "head": [quantity_text(h, "m") for h in loss],
    }
    return _link("loss-curve", ends) | {"loss": keys}


def pump(ends: tuple[str, str], law: Part, speed: float) -> Part:
    """Table of a pump with a check valve, because EPANET's pumps have no reverse flow.

    ends : names of the nodes `from` and `to`; speed : relative speed
    law : key with the head law at full speed, result of `curve` or `power`
    """
    return _link("pump", ends) | law | {"speed": rounded_number(speed), "check_valve": True}


def curve(points: list[tuple[float, float]]) -> Part:
    """Key `curve` of a pump: head law by points of flow [m3/s] and head [m].

    fvsolve and EPANET make the same curve from the points.
    """
    flow, head = zip(*points, strict=True)
    return {
        "curve": {
            "flow": [quantity_text(q, "l/s") for q in flow],
            "head": [quantity_text(h, "m") for h in head],
        }
    }


def power(watts: float) -> Part:
    """Key `power` of a pump: head law by constant power [W]."""
    return {"power": f"{watts * 1e-3:.10g} kW"}


def check_valve(ends: tuple[str, str], diameter: float, loss: float = 0.0) -> Part:
    """Table of a check valve with diameter [m]; ends : names of the nodes `from` and `to`

    loss : loss coefficient, 0 is replaced by `NO_LOSS`
    """
    part = _link("check-valve", ends) | {"diameter": quantity_text(diameter, "mm")}
    return part | {"loss_coefficient": rounded_number(loss or NO_LOSS)}


def regulating(
    kind: str,
    ends: tuple[str, str],
    diameter: float,
    setting: float,
    loss: float,
    time_constant: str = TIME_CONSTANT,
) -> Part:
    """Table of a regulating valve with diameter [m]; ends : names of the nodes `from` and `to`

    kind : "PRV", "PSV" or "FCV"; setting : head of water above the controlled end [m], for "FCV" flow [m3/s]
    loss : loss coefficient at full opening; 0 is replaced by `NO_LOSS`
    """
    part = _link(REGULATING[kind], ends)
    if kind == "FCV":
        part["set_flow"] = quantity_text(setting, "l/s")
    else:
        part["set_pressure"] = gauge_pressure(setting)
    part |= {"time_constant": time_constant, "diameter": quantity_text(diameter, "mm")}
    return part | {"loss_coefficient": rounded_number(loss or NO_LOSS)}


def leak(place: str, coefficient: float, exponent: float) -> Part:
    """Table of a leak that represents an emitter, whose flow [m3/s] is coefficient (head of water [m])^exponent.

    In the table the coefficient refers to a pressure in Pa. place : name of the node
    """
    per_pascal = coefficient / (WEIGHT) ** exponent
    return {
        "type": "leak",
        "from": place,
        "coefficient": rounded_number(per_pascal),
        "exponent": rounded_number(exponent),
    }


def general_losses(curve: list[list[float]]) -> tuple[list[tuple[float, float]], bool]:
    """(points of flow [m3/s] and loss [m], True if EPANET's loss is negative at small flows) of the curve of a GPV.

    EPANET continues the first section down to no flow, and the last section beyond the last point. No points if the
    loss falls anywhere, or is never above 0.
    """
    if (
        len(curve) < 2
        or curve[-1][1] <= 0.0
        or any(b[1] < a[1] for a, b in zip(curve, curve[1:], strict=False))
    ):
        return [], False
    first = max(k for k, (flow, _) in enumerate(curve[:-1]) if k == 0 or flow <= 0.0)
    (q0, h0), (q1, h1) = curve[first : first + 2]
    at_rest = h0 - (h1 - h0) / (q1 - q0) * q0
    points = [(0.0, at_rest), *((q, h) for q, h in curve if q > 0.0)]
    if abs(at_rest) <= ROUNDING * curve[-1][1]:
        return [(0.0, 0.0), *points[1:]], False
    if at_rest > 0.0:
        return points, False
    k = next(k for k, (_, loss) in enumerate(points) if loss > 0.0)
    (q0, h0), (q1, h1) = points[k - 1 : k + 1]
    return [(0.0, 0.0), (q0 - h0 * (q1 - q0) / (h1 - h0), 0.0), *points[k:]], True


def breaker_losses(
    setting: float, loss: float, diameter: float, most: float
) -> list[tuple[float, float]]:
    """Points of flow [m3/s] and loss [m] of a PBV: its setting [m], or the loss of the open valve if greater.

    loss : loss coefficient of the open valve for the velocity in the diameter [m], 0 for none; most : greatest loss [m]
    The lines between the points differ from the square of the flow by at most `LINE_ERROR`, see `MOST_POINTS`.
    """
    if not loss:
        return [(0.0, setting), (FAST * math.pi / 4.0 * diameter**2, setting)]
    square = MINOR_LOSS * loss / diameter**4
    equal = math.sqrt(setting / square)
    span = math.sqrt(most / square) - equal if most > setting else LEAST_SPAN * equal
    count = min(math.ceil(0.5 * span * math.sqrt(square / LINE_ERROR)), MOST_POINTS)
    flows = [equal + k * span / count for k in range(count + 1)]
    return [(0.0, setting), *((q, square * q * q) for q in flows)]


def loss_coefficient(drop: float, flow: float, diameter: float) -> float:
    """Loss coefficient of a head loss `drop` [m] at a flow [m3/s], for the velocity in a diameter [m]."""
    velocity = flow / (math.pi / 4.0 * diameter**2)
    return 2.0 * GRAVITY * drop / velocity**2


def _link(kind: str, ends: tuple[str, str]) -> Part:
    return {"type": kind, "from": ends[0], "to": ends[1]}


def _position(position: Any) -> Part:
    return {} if position is None else {"position": [rounded_number(x) for x in position]}
