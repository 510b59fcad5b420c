"""Links whose head loss follows a measured curve of their flow: filters, heat exchangers, backflow preventers."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.pump.head_curve import CurvePoints, keys_of, points
from fvsolve.parts.table_model import CaseContext, Faults, check_table, keys_json
from fvsolve.parts.value import ReadContext, Value, ValueFault
from fvsolve.units import show

DIMENSIONS = {"head": "head", "drop": "pressure_drop"}  # key of the losses -> dimension


@dataclass(frozen=True)
class Losses(Value):
    """Value of a case file for losses over the flow: points { flow, head } or { flow, drop }."""

    about: str = "points of the loss over the flow: `head` [m], or a pressure `drop` [Pa]; flows and losses rise"
    takes: ClassVar[str] = "`{ flow = [...], head = [...] }`, or `drop` in place of `head`"

    def read(self, given: Any, setting: ReadContext) -> CurvePoints:
        if isinstance(given, CurvePoints):
            return given
        check_table(given, 'for example { flow = ["0 l/s", "20 l/s"], head = ["0 m", "1.5 m"] }')
        stated = [key for key in DIMENSIONS if key in given]
        if len(stated) > 1:
            raise ValueFault(
                [((), "`head` and `drop` both give the losses; expected one of these keys")]
            )
        key = stated[0] if stated else "head"
        return points(given, key, DIMENSIONS[key], setting, faults_of=self.faults_of)

    def faults_of(
        self, given: dict[str, Any], flow: tuple[float, ...], loss: tuple[float, ...]
    ) -> list:
        """Faults of losses that fall as the flow rises, and of points without a flow or a loss."""
        key = "head" if "head" in given else "drop"
        faults = []
        for k, (before, after) in enumerate(zip(loss, loss[1:], strict=False)):
            if after < before:
                text = f"{show(given[key][k + 1])} comes after {show(given[key][k])}"
                faults.append(((key, k + 1), f"{text}; the loss must not fall as the flow rises"))
        if not any(loss):
            faults.append(((key,), "no loss above 0; expected at least one, or leave the link out"))
        if not any(flow):
            faults.append((("flow",), "no flow above 0; expected at least one"))
        return faults

    def json(self) -> dict[str, Any]:
        return {
            "anyOf": [keys_json(keys_of(key, dimension)) for key, dimension in DIMENSIONS.items()]
        }


class LossCurve(TwoPort, kind="loss-curve"):
    """Link whose loss of head follows points over its flow, equal in both directions.

    The loss is linear between the points and from no flow to the first point; beyond the last point it continues with
    the slope of the last section. A first point without flow and with a loss is the least loss of any flow. Where the
    loss is constant the drop hardly depends on the flow. Ports: from, to. Stored energy: none. Dissipated power: drop
    of p + rho g z times flow [W].
    """

    loss: Annotated[CurvePoints, Losses()]

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.loss.quantity == "head" and around.gravity == 0.0:
            yield (
                ("loss", "head"),
                "a head has no pressure without gravity; expected `drop`, a pressure drop",
            )
