"""Hill charts of turbines in a case file or a CSV file, and faults of their points."""

import math
from itertools import pairwise
from typing import Any, NamedTuple

from fvsolve.parts.csv_rows import CsvError, read_table_file, split_header
from fvsolve.parts.table_model import check_table, keys_json, read_keys
from fvsolve.parts.value import (
    NEEDED,
    Number,
    ReadContext,
    Rows,
    Value,
    ValueFault,
    between,
    faults_of,
)
from fvsolve.units import show

LEAST = 1e-3  # least valid unit speed, unit flow and opening
ANGLE_TOLERANCE = 1e-6  # angle between points regarded as zero [rad]
SPEED, FLOW, EFFICIENCY, TORQUE = "unit_speed", "unit_flow", "efficiency", "unit_torque"


def faults_of_shut(curve) -> list[tuple[str, str]]:
    """Faults (key, text) of the curve of opening 0, at which the vanes are shut; the key is "" for the whole curve."""
    if not len(curve.speed) == len(curve.flow) == len(curve.value) == 1 or curve.quantity != TORQUE:
        return [
            (
                "",
                f"vanes at opening 0 are shut; expected no curve, or a single point with a {TORQUE}",
            )
        ]
    faults = [(FLOW, f"{curve.flow[0]:g} is a flow through shut vanes; expected 0")] * (
        curve.flow[0] != 0.0
    )
    if not curve.speed[0] >= LEAST:
        faults.append(
            (SPEED, f"{curve.speed[0]:g} is out of range; expected a value of at least {LEAST:g}")
        )
    if curve.value[0] > 0.0:
        faults.append(
            (TORQUE, f"{curve.value[0]:g} drives the runner behind shut vanes; expected 0 or less")
        )
    return faults


def faults_of_curve(curve) -> list[tuple[str, str]]:
    """Faults (key, text) of the curve of an opening above 0; the key is "" for the whole curve."""
    if not len(curve.speed) == len(curve.flow) == len(curve.value):
        counts = f"{len(curve.speed)} of {SPEED}, {len(curve.flow)} of {FLOW}, {len(curve.value)} of {curve.quantity}"
        return [("", f"{counts}; expected equal numbers")]
    if len(curve.speed) < 2:
        return [("", "has one point; expected at least two")]
    points, faults = list(zip(curve.speed, curve.flow, strict=True)), []
    if curve.opening < LEAST:
        faults.append(
            ("opening", f"{curve.opening:g} is almost shut; expected at least {LEAST:g}, or 0")
        )
    if curve.quantity == EFFICIENCY and not all(n > 0.0 and q > 0.0 for n, q in points):
        k = next(k for k, (n, q) in enumerate(points) if not (n > 0.0 and q > 0.0))
        text = (
            f"gives no torque at point {k + 1}, {point_text(points[k])}; expected "
            f"{TORQUE} instead for the whole curve"
        )
        faults.append((EFFICIENCY, text))
    if not any(q >= LEAST for _, q in points):
        faults.append(
            (
                FLOW,
                f"has no value of {LEAST:g} or more; expected at least one, a flow that drives the turbine",
            )
        )
    if (dead := next((p for p in points if p[0] == 0.0 and p[1] <= 0.0), None)) is not None:
        text = (
            f"{point_text(dead)} is not a valid point: through a runner at rest a positive head drives a positive "
            "flow; expected a flow above 0 at unit speed 0"
        )
        faults.append(("", text))
    return faults or angle_faults(points)


def angle_faults(points: list[tuple[float, float]]) -> list[tuple[str, str]]:
    """Fault (key, text), in a list, if the angle of the points about the origin does not always rise or always fall.

    There is also a fault if they cross reverse flow at rest, or if the end with the least angle has no forward speed.
    points : (unit speed, unit flow) of each point
    """
    way = 0.0
    for k, ((n, q), (m, r)) in enumerate(pairwise(points)):
        across = n * r - q * m
        if abs(across) <= ANGLE_TOLERANCE * math.hypot(n, q) * math.hypot(m, r):
            text = (
                f"points {k + 1} and {k + 2}, {point_text((n, q))} and {point_text((m, r))}, are in line with the "
                f"origin; expected different angles, atan2({FLOW}, {SPEED})"
            )
            return [("", text)]
        if across * way < 0.0:
            rule = (
                f"its angle, atan2({FLOW}, {SPEED}), must rise or fall throughout: list the points in their order "
                "along the curve"
            )
            return [
                (
                    "",
                    f"turns back at point {k + 1}, {point_text((n, q))}; a curve may fold in {SPEED}, but {rule}",
                )
            ]
        way = across
        if (n > 0.0) != (m > 0.0) and (q * abs(m) + r * abs(n)) <= 0.0:
            text = (
                f"passes from {point_text((n, q))} to {point_text((m, r))} across reverse flow through a runner at "
                f"rest, through which a positive head drives a positive flow; expected {FLOW} above 0 at {SPEED} 0"
            )
            return [("", text)]
    if not (points[0] if way > 0.0 else points[-1])[0] >= LEAST:
        end = f"the end of the curve with the least angle, atan2({FLOW}, {SPEED})"
        return [
            (
                SPEED,
                f"is below {LEAST:g} at {end}; expected a forward speed, at which a turbine drives",
            )
        ]
    return []


def point_text(point: tuple[float, float]) -> str:
    """Text of a point (unit speed, unit flow), such as "(60, 0.5)"."""
    return f"({point[0]:g}, {point[1]:g})"


UNIT_RANGE = between(-1e4, 1e4)  # n11 and Q11 of any machine
UNITS = {SPEED: "rpm m^(1/2)", FLOW: "m^(1/2)/s", TORQUE: "N/m3"}
EXAMPLE = (
    "{ opening = 0.5, unit_speed = [60, 75], unit_flow = [0.52, 0.48], efficiency = [0.88, 0.85] }"
)


class OpeningCurve(NamedTuple):
    """Points of a hill chart at an opening of the vanes, in order along the curve.

    speed : unit speed n11 = N D / sqrt(H) [rpm m^(1/2)]; flow : unit flow Q11 = Q / (D^2 sqrt(H)) [m^(1/2)/s]
    value : efficiency [-], or unit torque T11 = T / (D^3 H) [N/m3]; quantity : key of `value`
    N : speed, D : runner diameter, H : head, Q : flow, T : torque
    """

    opening: float
    speed: tuple[float, ...]
    flow: tuple[float, ...]
    value: tuple[float, ...]
    quantity: str

    def table(self) -> dict[str, Any]:
        """Curve as a table of a case file."""
        return {
            "opening": self.opening,
            SPEED: list(self.speed),
            FLOW: list(self.flow),
            self.quantity: list(self.value),
        }

    def torques(self, weight: float) -> list[float]:
        """Unit torque T11 [N/m3] at the points; weight : rho g [N/m3]"""
        if self.quantity == TORQUE:
            return list(self.value)
        points = zip(self.speed, self.flow, self.value, strict=True)
        return [eta * weight * q * 30.0 / math.pi / n for n, q, eta in points]


class HillChart(NamedTuple):
    """Hill chart of a turbine.

    curves : curves of the openings above 0, in ascending order
    shut_point : (n11, T11), unit speed and braking unit torque with shut vanes, or None; given : value as in the case
    file
    """

    curves: tuple[OpeningCurve, ...]
    shut_point: tuple[float, float] | None
    given: Any

    def table(self) -> Any:
        """Value of the chart as in a case file."""
        return self.given


class HillChartValue(Value):
    """Value of a case file for a hill chart: curves of openings, as tables or as columns of a CSV file."""

    about = (
        "for each opening, points of n11 = N D / sqrt(H) [rpm m^(1/2)], Q11 = Q / (D^2 sqrt(H)) [m^(1/2)/s] and "
        "efficiency, or T11 = T / (D^3 H) [N/m3]"
    )
    takes = (
        "list of `{ opening, unit_speed = [...], unit_flow = [...], efficiency or unit_torque = [...] }`, "
        "or `{ file, sheet }`"
    )
    keys = {
        "opening": (Number(between(0, 1)), NEEDED),
        SPEED: (Rows("number", UNIT_RANGE), NEEDED),
        FLOW: (Rows("number", UNIT_RANGE), NEEDED),
        EFFICIENCY: (Rows("number", between(0, 1)), None),
        TORQUE: (Rows("number", between(-1e8, 1e8)), None),
    }

    def read(self, given: Any, setting: ReadContext) -> HillChart:
        if isinstance(given, HillChart):
            return given
        if isinstance(given, dict) and "file" in given:
            return from_file(given, setting)
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(
                f'{show(given)} is not a list of curves; expected [{EXAMPLE}, ...] or {{ file = "chart.csv" }}'
            )
        curves, faults = {}, []
        for k, entry in enumerate(given):
            try:
                curves[k] = self.curve(entry, setting)
            except ValueError as error:
                faults += faults_of(error, k)
        places = {k: (k,) for k in curves}
        return chart_of(curves, places, faults, [entry.table() for entry in curves.values()])

    def curve(self, given: Any, setting: ReadContext) -> OpeningCurve:
        """Read the curve of an opening from its table; raises ValueError, or ValueFault for faults of its keys."""
        check_table(given, f"for example {EXAMPLE}")
        keys = read_keys(given, self.keys, setting)
        words = [word for word in (EFFICIENCY, TORQUE) if keys[word] is not None]
        if len(words) != 1:
            text = (
                f"{EFFICIENCY} and {TORQUE} are given; keep one"
                if words
                else f"{EFFICIENCY} or {TORQUE} is missing"
            )
            raise ValueFault([(tuple(words[1:]), text)])
        return OpeningCurve(keys["opening"], keys[SPEED], keys[FLOW], keys[words[0]], words[0])

    def json(self) -> dict[str, Any]:
        return {
            "anyOf": [
                {"type": "array", "items": keys_json(self.keys), "minItems": 1},
                {"type": "object"},
            ]
        }


def from_file(given: dict[str, Any], setting: ReadContext) -> HillChart:
    """Hill chart from a CSV file with the columns opening, unit_speed, unit_flow, and efficiency or unit_torque.

    The points of each opening are in order along its curve. given : table { file, sheet } of the case file
    Raises ValueFault with all faults.
    """
    path, rows, source = read_table_file(given, setting)
    try:
        columns, word = columns_of(rows)
    except ValueError as error:
        raise ValueFault([(("file",), str(error))]) from None
    points: dict[float, list] = {}
    for opening, *point in zip(*columns, strict=True):
        points.setdefault(opening, []).append(point)
    curves, faults = {}, []
    for opening, rows in points.items():
        try:
            given = dict(zip((SPEED, FLOW, word), map(list, zip(*rows, strict=True)), strict=True))
            curves[opening] = HillChartValue().curve({"opening": opening, **given}, setting)
        except ValueFault as error:
            faults += [
                (("file",), f"{path.name}, opening {opening:g}: {below[0]}: {text}")
                for below, text in error.faults
            ]
    return chart_of(curves, dict.fromkeys(curves, ("file",)), faults, source, f"{path.name}, ")


def columns_of(rows) -> tuple[list, str]:
    """(columns, key of the last column) of the CSV file of a hill chart; rows : rows of the file

    The columns are opening, n11, Q11, and efficiency or T11.
    Raises ValueError for a missing column, a unit that does not fit, or a text instead of a number.
    """
    words = [word for word in (EFFICIENCY, TORQUE) if word in rows.names]
    if len(words) != 1:
        state = "has both; keep one" if words else "has neither"
        raise ValueError(
            f"{rows.file}: expected a column {EFFICIENCY} or {TORQUE}; the file {state}"
        )
    columns = []
    for name in ("opening", SPEED, FLOW, words[0]):
        column = rows.column(name, 0)
        unit = split_header(rows.header[column])[1]
        if name in UNITS and unit not in ("", UNITS[name]):
            raise CsvError(
                rows.file, f"column {show(rows.header[column])}: expected {name} in {UNITS[name]}"
            )
        columns.append(
            rows.plain(column) if name in UNITS else rows.numbers(column, "number").tolist()
        )
    return columns, words[0]


def chart_of(curves: dict, places: dict, faults: list, source: Any, file: str = "") -> HillChart:
    """Hill chart made of the given curves. Raises ValueFault with all faults.

    curves : index or opening -> curve; places : index or opening -> key path of the curve, for messages
    faults : faults found before; source : value as in the case file; file : prefix of messages about a CSV file
    """
    seen: dict[float, Any] = {}
    for k, curve in curves.items():
        if curve.opening in seen:
            first = seen[curve.opening]
            message = (
                f"{curve.opening:g} is already the opening of hill_chart[{first}]; "
                "give a single curve for each opening"
            )
            faults.append(((*places[k], "opening"), message))
        seen.setdefault(curve.opening, k)
        keys, name = places[k], f"{file}opening {curve.opening:g}: "
        texts = faults_of_shut(curve) if curve.opening == 0.0 else faults_of_curve(curve)
        faults += [
            ((*keys, key) if not file and key else keys, (name if file else "") + text)
            for key, text in texts
        ]
    open_curves = sorted(
        (curve for curve in curves.values() if curve.opening > 0.0), key=lambda curve: curve.opening
    )
    if not open_curves and not faults:
        faults.append(((), "has no curve of an opening above 0; expected at least one"))
    if faults:
        raise ValueFault(faults)
    shut_point = next(
        ((curve.speed[0], curve.value[0]) for curve in curves.values() if curve.opening == 0.0),
        None,
    )
    return HillChart(tuple(open_curves), shut_point, source)
