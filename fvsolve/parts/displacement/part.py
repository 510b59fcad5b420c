"""Displacement pumps and motors: keys and faults."""

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.nodes_and_links import Ports, TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.table_model import CaseContext, Faults, Nested, Table
from fvsolve.parts.value import Number, Quantity, Text, UsualRange, between, nonnegative, positive

DISPLACEMENTS = UsualRange(1e-9, 1e-2, "0.006 cc/rev to 63 l/rev")  # [m3/rad]
SPEEDS = UsualRange(0.1, 950.0, "1 rpm of motors of winches to 9000 rpm of pumps of aircraft")
# lag of a compensator without `setting_time` [s], of axial piston pumps of 28 to 100 cc/rev
LAG = 0.05


class Compensator(Table):
    """Pressure compensator: share of the displacement (set - p) / range, between 0 and 1, with the pressure p at `to`.

    `set` is `set_pressure`, or the pressure at `senses` plus `margin`, or the lesser if both are given.
    """

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("set_pressure", "senses"),)

    set_pressure: Annotated[
        Schedule | None,
        Scheduled(
            "pressure",
            about="pressure at `to` at which the displacement is 0 [Pa]",
            usual=UsualRange(2e5, 1e8, "of compensators"),
        ),
    ] = None
    range: Annotated[
        float,
        Quantity(
            "pressure_drop",
            positive,
            "pressure range below it in which the displacement falls to 0 [Pa]",
            UsualRange(1e3, 1e8, "of compensators"),
        ),
    ]
    senses: Annotated[
        str | None, Text("place whose pressure plus `margin` is the set pressure (load sensing)")
    ] = None
    margin: Annotated[
        float | None,
        Quantity(
            "pressure_drop", nonnegative, "pressure above that at `senses`, with `senses` [Pa]"
        ),
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        for key, other in (("senses", "margin"), ("margin", "senses")):
            if key in given and other not in given:
                faults.append(((key,), f"needs the key `{other}`"))
        return faults


class DisplacementMachine(TwoPort):
    """Base of displacement pumps and motors: keys of the volume per angle, of the shaft and of losses."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("ports", "speed"),
        ("volumetric_efficiency", "leakage"),
        ("mechanical_efficiency", "viscous_friction"),
        ("mechanical_efficiency", "friction_torque"),
    )
    joins: ClassVar[dict[str, str]] = {**TwoPort.joins, "shaft": "rotational"}
    may_lack: ClassVar[tuple[str, ...]] = ("shaft",)
    network_ports: ClassVar[tuple[str, ...]] = ("shaft",)
    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "torque": "torque", "setting": "number"}
    main_quantities: ClassVar[tuple[str, ...]] = ("flow", "torque")

    shaft_port: Annotated[
        dict[str, str] | None,
        Ports(("shaft",), "shaft or housing that it turns with, instead of `speed`"),
    ] = Field(None, alias="ports")
    speed: Annotated[
        Schedule | None,
        Scheduled(
            "angular_velocity",
            about="angular velocity, if no shaft turns with it [rad/s]",
            usual=UsualRange(-950.0, 950.0, "to 9000 rpm of pumps of aircraft"),
        ),
    ] = None
    displacement: Annotated[
        float,
        Quantity(
            "displacement", positive, "volume per angle at full setting [m3/rad]", DISPLACEMENTS
        ),
    ]
    setting: Annotated[
        Schedule,
        Scheduled(
            "number", between(-1, 1), "displacement over `displacement`; negative over centre"
        ),
    ] = Field(default_factory=lambda: constant(1.0))
    setting_time: Annotated[
        float | None,
        Quantity(
            "time",
            positive,
            f"time constant of the setting [s]; no delay, with `compensator` {LAG} if left out",
            UsualRange(1e-4, 100.0, "servo drives to hand wheels"),
        ),
    ] = None
    volumetric_efficiency: Annotated[
        float | None,
        Number(
            between(0, 1, open=True),
            "volumetric efficiency at `rated_pressure` and `rated_speed`, instead of `leakage`",
        ),
    ] = None
    mechanical_efficiency: Annotated[
        float | None,
        Number(
            between(0, 1, open=True),
            "hydromechanical efficiency at the same point, whose losses are half viscous, half "
            "dry friction",
        ),
    ] = None
    rated_pressure: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            "pressure difference of the efficiencies [Pa]",
            UsualRange(1e4, 1e8, "cooling circuits to presses"),
        ),
    ] = None
    rated_speed: Annotated[
        float | None,
        Quantity("angular_velocity", positive, "speed of the efficiencies [rad/s]", SPEEDS),
    ] = None
    leakage: Annotated[
        float | None,
        Quantity(
            "leakage", nonnegative, "leakage flow per pressure difference [m3/s/Pa]; 0 if left out"
        ),
    ] = None
    viscous_friction: Annotated[
        float | None,
        Quantity(
            "rotational_damping",
            nonnegative,
            "friction torque per speed [N m s/rad]; 0 if left out",
        ),
    ] = None
    friction_torque: Annotated[
        float | None, Quantity("torque", nonnegative, "torque of dry friction [N m]; 0 if left out")
    ] = None

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return super().ports | (self.shaft_port or {})

    @property
    def shaft(self) -> str | None:
        """Place of the network of rotation that turns with it; None if its speed is given."""
        return None if self.shaft_port is None else self.shaft_port["shaft"]

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if "ports" not in given and "speed" not in given:
            text = 'its speed is missing; expected ports = { shaft = "..." } or, for example, speed = "1500 rpm"'
            faults.append(((), text))
        efficient = [
            key for key in ("volumetric_efficiency", "mechanical_efficiency") if key in given
        ]
        for key in ("rated_pressure", "rated_speed"):
            if efficient and key not in given:
                faults.append(((efficient[0],), f"needs the key `{key}`"))
            elif not efficient and key in given:
                text = "has no effect without `volumetric_efficiency` or `mechanical_efficiency`; remove this key"
                faults.append(((key,), text))
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        node = around.nodes.get(self.shaft or "")
        given = getattr(node, "reference_potential", None)
        if given is not None and given.constant and given.first == 0.0:
            yield (
                ("ports", "shaft"),
                f"{self.shaft} is a housing at rest, so nothing turns; expected a shaft",
            )

    @property
    def losses(self) -> tuple[float, float, float]:
        """(leakage [m3/s/Pa], viscous friction [N m s/rad], torque of dry friction [N m])."""
        leakage = self.leakage or 0.0
        viscous = self.viscous_friction or 0.0
        dry = self.friction_torque or 0.0
        if self.volumetric_efficiency is not None:
            leakage = (
                self.displacement * self.rated_speed * self.flow_loss(self.volumetric_efficiency)
            )
            leakage /= self.rated_pressure
        if self.mechanical_efficiency is not None:
            dry = (
                0.5
                * self.displacement
                * self.rated_pressure
                * self.torque_loss(self.mechanical_efficiency)
            )
            viscous = dry / self.rated_speed
        return leakage, viscous, dry

    def flow_loss(self, efficiency: float) -> float:
        """Leakage over the ideal flow at the rated point."""
        raise NotImplementedError

    def torque_loss(self, efficiency: float) -> float:
        """Loss of torque over the ideal torque at the rated point."""
        raise NotImplementedError


class DisplacementPump(DisplacementMachine, kind="displacement-pump"):
    """Displacement pump, q = x D w - leakage dp, T = x D dp + viscous_friction w + friction_torque sign w.

    q is the flow from `from` to `to`, dp = p_to - p_from, T the torque that it takes, D the displacement, w the angular
    velocity and x the setting. Efficiencies at the rated point give the losses: flow D w volumetric_efficiency, torque
    D dp / mechanical_efficiency. With `compensator` the pressure at `to` reduces x. Ports: from, to, shaft. Stored
    energy: none. Dissipated power: leakage dp^2 + viscous_friction w^2 + friction_torque |w| [W].
    """

    sensed_keys: ClassVar[tuple[str, ...]] = ("compensator.senses",)

    compensator: Annotated[
        Compensator | None, Nested(Compensator, "pressure compensator, or load sensing")
    ] = None

    def flow_loss(self, efficiency: float) -> float:
        return 1.0 - efficiency

    def torque_loss(self, efficiency: float) -> float:
        return 1.0 / efficiency - 1.0


class DisplacementMotor(DisplacementMachine, kind="displacement-motor"):
    """Displacement motor, q = x D w + leakage dp, T = x D dp - viscous_friction w - friction_torque sign w.

    q is the flow from `from` to `to`, dp = p_from - p_to, T the torque that it delivers, D the displacement, w the
    angular velocity and x the setting. Efficiencies at the rated point give the losses: flow D w /
    volumetric_efficiency, torque D dp mechanical_efficiency. Ports: from, to, shaft. Stored energy: none. Dissipated
    power: leakage dp^2 + viscous_friction w^2 + friction_torque |w| [W].
    """

    def flow_loss(self, efficiency: float) -> float:
        return 1.0 / efficiency - 1.0

    def torque_loss(self, efficiency: float) -> float:
        return 1.0 - efficiency
