"""What lies between nodes and carries flow. Knows what every link has; knows no node but by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.errors import FvsolveError
from fvsolve.parts.table import Table, keys_json, read_keys
from fvsolve.parts.value import NEEDED, Setting, Text, Value
from fvsolve.units import show


class Link(Table):
    """A part whose ports join places; flow is positive into it at each port.

    Potential times flow, summed over the ports, is the power [W] it takes up: pressure and volume flow where the
    domain is hydraulic, velocity and force where it is translational, angular velocity and torque where rotational.
    """

    kind: ClassVar[str] = ""
    kinds: ClassVar[dict[str, type[Link]]] = {}
    quantities: ClassVar[dict[str, str]] = {"flow": "flow"}
    asked: ClassVar[tuple[str, ...]] = ()  # quantities that are recorded only where they are asked for
    along: ClassVar[dict[str, str]] = {}  # quantities that also exist at a fraction of the length
    joins: ClassVar[dict[str, str]] = {}  # port -> domain of the place it wants
    may_lack: ClassVar[tuple[str, ...]] = ()  # ports that may join nothing
    no_scalars: ClassVar[str] = ""  # why a case with scalars cannot have it yet
    own_scalars: ClassVar[str] = ""  # which values of scalars it states: "along" its length; none if empty
    owns: ClassVar[dict[str, str]] = {}  # place of its own, `LINK.PLACE` to others -> domain

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Link]]:
        """(places, links) that it stands for, by name: itself, and what it owns as `NAME.PLACE`."""
        return {}, {name: self}

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if kind:
            if kind in Link.kinds:
                raise FvsolveError(f"a link of type {show(kind)} is there already; wanted another name")
            cls.kind = kind
            Link.kinds[kind] = cls


class TwoPort(Link):
    """A link with the ports `from` and `to`; its own flow [m3/s] is the one at `from`."""

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic", "to": "hydraulic"}

    from_: Annotated[str, Text("the place it starts from"), Field(alias="from")]
    to: Annotated[str, Text("the place it leads to")]

    @property
    def ports(self) -> dict[str, str]:
        """Port name -> place."""
        return {"from": self.from_, "to": self.to}


class Coupling(TwoPort):
    """A link between masses on one axis, or points in space; its force [N] pushes `to` forward and `from` back as much.

    Between points x_to - x_from is their distance, and forward is away from the other one.
    """

    joins: ClassVar[dict[str, str]] = {"from": "translational or spatial", "to": "translational or spatial"}
    quantities: ClassVar[dict[str, str]] = {"force": "force"}


@dataclass(frozen=True)
class Ports(Value):
    """The table `ports` of a link with other ports than `from` and `to`: port name -> place."""

    names: tuple[str, ...]
    about: str = "the place that each port joins"

    def read(self, given: Any, setting: Setting) -> dict[str, str]:
        if not isinstance(given, dict):
            example = ", ".join(f'{name} = "..."' for name in self.names)
            raise ValueError(f"{show(given)} is no table; wanted {{ {example} }}")
        return read_keys(given, self.keys(), setting)

    def keys(self) -> dict[str, tuple[Value, Any]]:
        return {name: (Text(), NEEDED) for name in self.names}

    @property
    def takes(self) -> str:
        return f"`{{ {', '.join(self.names)} }}`"

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys())
