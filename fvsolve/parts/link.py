"""Links: base classes of all parts that join places and carry flow, force or torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.errors import FvsolveError
from fvsolve.parts.table_model import Table, keys_json, read_keys
from fvsolve.parts.value import NEEDED, ReadContext, Text, Value
from fvsolve.units import show


class Link(Table):
    """Part with ports that join places; flow is positive into the part at each port.

    The sum of potential times flow over the ports is the power [W] into the part. Potential and flow are pressure and
    volume flow (hydraulic domain), velocity and force (translational), or angular velocity and torque (rotational).
    """

    kind: ClassVar[str] = ""
    kinds: ClassVar[dict[str, type[Link]]] = {}
    quantities: ClassVar[dict[str, str]] = {"flow": "flow"}
    on_request: ClassVar[tuple[str, ...]] = ()  # quantities that are recorded only by explicit probes
    along: ClassVar[dict[str, str]] = {}  # quantities that also exist at a fraction of the length
    joins: ClassVar[dict[str, str]] = {}  # port -> required domain of its place
    may_lack: ClassVar[tuple[str, ...]] = ()  # ports that may join nothing
    no_scalars: ClassVar[str] = ""  # reason why a case with scalars cannot have this part yet
    own_scalars: ClassVar[str] = ""  # scalars that it states: "along" its length; none if empty
    owns: ClassVar[dict[str, str]] = {}  # own place, `LINK.PLACE` for other parts -> domain

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Link]]:
        """(places, links) of the solved network for this link, each by name.

        They contain the link itself, and its own places `NAME.PLACE`.
        """
        return {}, {name: self}

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if kind:
            if kind in Link.kinds:
                raise FvsolveError(f"a link of type {show(kind)} exists already; expected another name")
            cls.kind = kind
            Link.kinds[kind] = cls


class TwoPort(Link):
    """Link with the ports `from` and `to`; its flow [m3/s] is the flow at `from`."""

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic", "to": "hydraulic"}

    from_: Annotated[str, Text("place at its start"), Field(alias="from")]
    to: Annotated[str, Text("place at its end")]

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return {"from": self.from_, "to": self.to}


class Coupling(TwoPort):
    """Link between two masses on an axis, or between two points in space.

    Its force [N] acts on `to` in the positive direction and on `from` in the negative direction. Between points,
    x_to - x_from is their distance, and a positive force pushes them apart.
    """

    joins: ClassVar[dict[str, str]] = {"from": "translational or spatial", "to": "translational or spatial"}
    quantities: ClassVar[dict[str, str]] = {"force": "force"}


@dataclass(frozen=True)
class Ports(Value):
    """Value of a case file for the key `ports` of a link with other ports than `from` and `to`: port name -> place."""

    names: tuple[str, ...]
    about: str = "place of each port"

    def read(self, given: Any, setting: ReadContext) -> dict[str, str]:
        if not isinstance(given, dict):
            example = ", ".join(f'{name} = "..."' for name in self.names)
            raise ValueError(f"{show(given)} is not a table; expected {{ {example} }}")
        return read_keys(given, self.keys(), setting)

    def keys(self) -> dict[str, tuple[Value, Any]]:
        return {name: (Text(), NEEDED) for name in self.names}

    @property
    def takes(self) -> str:
        return f"`{{ {', '.join(self.names)} }}`"

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys())
