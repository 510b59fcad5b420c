"""Values of a case file for head curve, efficiency, power and Suter table of a pump; published Suter tables."""

import functools
import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fvsolve.data import read_table
from fvsolve.parts.table_model import check_table, keys_json, read_keys, read_lists
from fvsolve.parts.value import (
    NEEDED,
    PROFILE,
    Choice,
    Number,
    Quantity,
    ReadContext,
    Rows,
    Value,
    ValueFault,
    between,
    nonnegative,
    positive,
)
from fvsolve.units import show

NAMES = ("radial-25", "radial-35", "mixed-94", "mixed-145", "axial-260")  # by rising specific speed


@dataclass(frozen=True)
class Quadrants:
    """Values of WH and WB at equal intervals of x from 0 to 2 pi, and the names of the published tables used.

    x = pi + atan2(v, n), with flow v and speed n over their rated values; head, torque : values of WH and WB
    words : names of the tables
    """

    head: tuple[float, ...]
    torque: tuple[float, ...]
    words: str


@functools.cache
def suter_tables() -> dict[str, tuple[tuple[float, ...], tuple[float, ...]]]:
    """Values of WH and of WB of each published table : name -> (WH, WB)."""
    given = read_table("suter_tables")
    return {name: (tuple(given[name]["head"]), tuple(given[name]["torque"])) for name in NAMES}


def quadrants(speed: float) -> Quadrants:
    """Suter table for a specific speed [rpm, m3/s, m], interpolated between published tables over its logarithm.

    Outside their range it is the nearest table.
    """
    logs = [math.log(read_table("suter_tables")[name]["speed"]) for name in NAMES]
    place = min(max(math.log(speed), logs[0]), logs[-1])
    k = max(j for j in range(len(logs) - 1) if logs[j] <= place)
    share = (place - logs[k]) / (logs[k + 1] - logs[k])
    ends = suter_tables()[NAMES[k]], suter_tables()[NAMES[k + 1]]
    if share in (0.0, 1.0):
        return Quadrants(*ends[int(share)], NAMES[k + int(share)])
    head, torque = (
        tuple((1.0 - share) * a + share * b for a, b in zip(*pair, strict=True))
        for pair in zip(*ends, strict=True)
    )
    return Quadrants(head, torque, f"{NAMES[k]} and {NAMES[k + 1]}")


# allowed difference of first and last value of a Suter table, over the greatest value
ROUNDING = 1e-6


@dataclass(frozen=True)
class CurvePoints:
    """Head, efficiency or power of a pump over its flow.

    flow : flows of the points [m3/s]; value : values at the points; quantity : key of the values, such as "head"
    coefficients : coefficients of a polynomial of the flow, instead of points
    """

    flow: tuple[float, ...] = ()
    value: tuple[float, ...] = ()
    quantity: str = "head"
    coefficients: tuple[float, ...] = ()

    def table(self) -> dict[str, list[float]]:
        """Curve as a table of a case file: key -> list."""
        if self.coefficients:
            return {"coefficients": list(self.coefficients)}
        return {"flow": list(self.flow), self.quantity: list(self.value)}


def points(
    given: dict[str, Any],
    word: str,
    dimension: str,
    setting: ReadContext,
    range=nonnegative,
    faults_of=lambda *_: [],
) -> CurvePoints:
    """Read a table { flow, WORD } with points over the flow.

    word : key of the values; dimension, range : dimension and valid range of the values
    faults_of : function of (table, flows, values) that returns further faults
    Raises ValueFault if flows do not rise, lengths differ, or `faults_of` finds faults.
    """
    further = functools.partial(faults_of, given)
    return CurvePoints(
        *read_lists(given, keys_of(word, dimension, range), setting, "flows", further), word
    )


def keys_of(word: str, dimension: str, range=nonnegative) -> dict[str, tuple[Value, Any]]:
    return {"flow": (Rows("flow", nonnegative), NEEDED), word: (Rows(dimension, range), NEEDED)}


class HeadCurve(Value):
    """Value of a case file for a head curve: points { flow, head }, or the coefficients of a polynomial of the flow."""

    about = "head [m] over flow [m3/s] at relative speed 1: points, or coefficients of powers of the flow"
    takes = "`{ flow = [...], head = [...] }`, or `{ coefficients = [...] }`"
    polynomial = {"coefficients": (Rows("number"), NEEDED)}

    def read(self, given: Any, setting: ReadContext) -> CurvePoints:
        if isinstance(given, CurvePoints):
            return given
        check_table(given, 'for example { flow = ["50 l/s"], head = ["40 m"] }')
        if "coefficients" in given:
            coefficients = read_keys(given, self.polynomial, setting)["coefficients"]
            self.check_polynomial(coefficients)
            return CurvePoints(coefficients=coefficients)
        return points(given, "head", "head", setting, nonnegative, self.faults_of)

    def faults_of(
        self, given: dict[str, Any], flow: tuple[float, ...], head: tuple[float, ...]
    ) -> list:
        """Faults of a single point without positive flow and head, or of heads that do not fall as the flow rises."""
        faults = []
        if len(flow) == 1 and not (flow[0] > 0 and head[0] > 0):
            faults.append(
                (
                    (),
                    "a single point must have a flow and a head above 0; correct the point, or give two or more",
                )
            )
        for k, (before, after) in enumerate(zip(head, head[1:], strict=False)):
            if not after < before:
                text = f"{show(given['head'][k + 1])} comes after {show(given['head'][k])}"
                faults.append((("head", k + 1), f"{text}; the head must fall as the flow rises"))
        return faults

    def check_polynomial(self, coefficients: tuple[float, ...]) -> None:
        """Raise ValueFault if the head of a polynomial does not fall from above 0 to 0, or rises at a lower flow."""
        end = zero_head_flow(coefficients)
        if coefficients[0] <= 0.0 or end is None:
            raise ValueFault(
                [
                    (
                        ("coefficients",),
                        "the head must start above 0 and fall to 0 at some flow; for example "
                        "[60.0, 0.0, -900.0], a head of 60 m - 900 Q^2, Q in m3/s",
                    )
                ]
            )
        slope = np.polynomial.polynomial.polyder(coefficients)
        flows = np.linspace(0.0, end, 1001)
        rises = np.flatnonzero(np.polynomial.polynomial.polyval(flows, slope) > 0.0)
        if rises.size:
            text = f"the head rises at a flow of {flows[rises[0]]:.4g} m3/s; the head must fall as the flow rises"
            raise ValueFault([(("coefficients",), text)])

    def json(self) -> dict[str, Any]:
        return {"anyOf": [keys_json(keys_of("head", "head")), keys_json(self.polynomial)]}


def zero_head_flow(coefficients: tuple[float, ...]) -> float | None:
    """Least positive flow [m3/s] at which a polynomial of the flow has the head 0; None for no such flow."""
    roots = (
        np.polynomial.polynomial.polyroots(np.trim_zeros(coefficients, "b"))
        if any(coefficients)
        else []
    )
    real = [
        float(root.real)
        for root in roots
        if abs(root.imag) <= 1e-12 * abs(root) and root.real > 0.0
    ]
    return min(real, default=None)


@dataclass(frozen=True)
class Efficiency(Value):
    """Value of a case file for the efficiency of a pump: a number, or points { flow, efficiency }."""

    about: str = "efficiency, hydraulic power over shaft power: at the rated point, or over flow; 0.75 if left out"
    takes = "-, or `{ flow = [...], efficiency = [...] }`"
    changes = PROFILE
    number = Number(between(0, 1, open=True))

    def read(self, given: Any, setting: ReadContext) -> float | CurvePoints:
        if isinstance(given, CurvePoints):
            return given
        if isinstance(given, dict):
            curve = points(given, "efficiency", "number", setting, between(0, 1))
            if not any(
                q > 0.0 and eta > 0.0 for q, eta in zip(curve.flow, curve.value, strict=True)
            ):
                raise ValueFault(
                    [(("efficiency",), "no value above 0 at a flow above 0; expected at least one")]
                )
            return curve
        return self.number.read(given, setting)

    def json(self) -> dict[str, Any]:
        return {"anyOf": [self.number.json(), keys_json(keys_of("efficiency", "number"))]}


class ShaftPower(Value):
    """Value of a case file for the shaft power of a pump: points { flow, power }."""

    about = "power at the shaft [W] over flow, at relative speed 1, instead of `efficiency`"
    takes = "`{ flow = [...], power = [...] }`"
    changes = PROFILE

    def read(self, given: Any, setting: ReadContext) -> CurvePoints:
        if isinstance(given, CurvePoints):
            return given
        check_table(given, 'for example { flow = [0, "50 l/s"], power = [...] }')
        return points(given, "power", "power", setting)

    def json(self) -> dict[str, Any]:
        return keys_json(keys_of("power", "power"))


@dataclass(frozen=True)
class SuterTable:
    """Four-quadrant characteristic of a pump: head = rated_head (n^2 + v^2) WH(x), with relative speed n and flow v.

    The torque is rated torque (n^2 + v^2) WB(x), with x = pi + atan2(v, n), v = flow / rated_flow and n = speed / rated
    speed.
    rated_flow, rated_head : rated point [m3/s], [m]
    head, torque : values of the functions WH and WB at equal intervals of x from 0 to 2 pi
    """

    rated_flow: float
    rated_head: float
    head: tuple[float, ...]
    torque: tuple[float, ...]

    def table(self) -> dict[str, Any]:
        """Suter table as a table of a case file."""
        table = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in table.items()
        }


class Suter(Value):
    """Value of a case file for a Suter table of a pump: a published table, or its values of WH and WB."""

    about = "four-quadrant characteristic: WH and WB at equal intervals of x = pi + atan2(flow / rated, speed / rated)"
    takes = "`{ rated_flow, rated_head, table }`, or `{ rated_flow, rated_head, head = [...], torque = [...] }`"
    keys = {
        "rated_flow": (Quantity("flow", positive), NEEDED),
        "rated_head": (Quantity("head", positive), NEEDED),
        "table": (Choice("table", NAMES, "a published table"), None),
        "head": (Rows("number"), ()),
        "torque": (Rows("number"), ()),
    }

    def read(self, given: Any, setting: ReadContext) -> SuterTable:
        if isinstance(given, SuterTable):
            return given
        check_table(given, f"keys {', '.join(self.keys)}")
        values = read_keys(given, self.keys, setting)
        table = values.pop("table")
        if table is not None and ("head" in given or "torque" in given):
            raise ValueFault(
                [
                    (
                        ("table",),
                        "already gives head and torque; remove `table`, or remove `head` and `torque`",
                    )
                ]
            )
        if table is not None:
            values["head"], values["torque"] = suter_tables()[table]
        head = values["head"]
        torque = values["torque"]
        faults = []
        if len(head) != len(torque):
            faults.append(
                (
                    ("torque",),
                    f"has length {len(torque)}, but `head` has length {len(head)}; expected equal lengths",
                )
            )
        if not head and not torque:
            raise ValueFault(
                [((), f"expected `table`, or `head` and `torque`; tables are {', '.join(NAMES)}")]
            )
        for key, series in (("head", head), ("torque", torque)):
            if len(series) < 9:
                faults.append(
                    ((key,), f"{len(series)} values; expected at least 9, from x = 0 to x = 2 pi")
                )
            elif abs(series[0] - series[-1]) > ROUNDING * max(map(abs, series)):
                text = (
                    f"ends at {series[-1]:g} and begins at {series[0]:g}; expected equal values, because "
                    "x = 2 pi is x = 0 again"
                )
                faults.append(((key,), text))
        if faults:
            raise ValueFault(faults)
        values["head"], values["torque"] = ((*series[:-1], series[0]) for series in (head, torque))
        return SuterTable(**values)

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys)
