"""Base classes of nodes and of links."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.carried_scalar import ScalarValues
from fvsolve.parts.kinds import Kinds
from fvsolve.parts.table_model import Table, check_table, keys_json, read_keys
from fvsolve.parts.value import NEEDED, VALUE, Quantity, ReadContext, Rows, Text, UsualRange, Value

# of nodes in networks of potential and flow
NETWORK_DOMAINS = ("rotational", "electrical", "thermal")
USUAL_ELEVATIONS = UsualRange(-12e3, 9e3, "boreholes to mountains")


class Part(Table):
    """Base of nodes and links: type in the case file, and scalars.

    kinds : type in the case file -> class; noun : word for messages; own_scalars : scalars that the part states, none
    if empty: "start" or "inflow" of a node, "along" the length of a link
    """

    noun: ClassVar[str] = ""
    kind: ClassVar[str] = ""
    kinds: ClassVar[Kinds] = Kinds()
    no_scalars: ClassVar[str] = ""  # reason why a case with scalars cannot have this part yet
    own_scalars: ClassVar[str] = ""
    added: ClassVar[bool] = False  # True if another part adds it to the case: it is not in the file
    type_in_file: ClassVar[str] = ""  # type in the case file of a variant with a kind of its own

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if not cls.__module__.startswith("fvsolve."):
            from fvsolve.core.assembly.lowering_checks import check_dimensions, check_methods

            check_dimensions(cls)
            check_methods(cls)
        if kind:
            cls.kind = kind
            cls.kinds.declare(kind, cls, f"a {cls.noun} of type")

    @property
    def words(self) -> tuple[str, ...]:
        """Words that may wake features, see `core.assembly.features`."""
        return (f"kind {self.kind}",)

    @classmethod
    def variant(cls, given: dict[str, Any]) -> "type[Part]":
        """Class of a part with the given keys: this class, or a subclass with other ports or quantities."""
        return cls


class Node(Part):
    """Place with a single potential.

    It is a pressure at its elevation (hydraulic), a velocity (translational or spatial), an angular velocity
    (rotational), a voltage (electrical) or a temperature (thermal).

    Ports: those of the links that name it. Stored and dissipated energy: none, unless its type states otherwise.
    """

    noun: ClassVar[str] = "node"
    kinds: ClassVar[Kinds] = Kinds()
    quantities: ClassVar[dict[str, str]] = {
        "pressure": "pressure",
        "gauge_pressure": "gauge_pressure",
        "head": "head",
    }
    fixes_pressure: ClassVar[bool] = False
    # key of a prescribed flow, and its sign as flow into links; 0 for a prescribed pressure
    driven: ClassVar[tuple[str, float] | None] = None
    # | "translational" | "spatial" | "rotational" | "electrical" | "thermal"
    domain: ClassVar[str] = "hydraulic"
    # quantities that are recorded where a case has no probes
    main_quantities: ClassVar[tuple[str, ...]] = ()

    @property
    def words(self) -> tuple[str, ...]:
        return (*super().words, f"domain {self.domain}")

    elevation: Annotated[
        float | None,
        Quantity(
            "length",
            about="elevation above datum, at all nodes or none [m]; "
            "0 (reservoir with `head`: that of the other end of its first link) if left out",
            usual=USUAL_ELEVATIONS,
        ),
    ] = None
    position: Annotated[
        tuple[float, float] | None,
        Rows("length", length=2, about="position [x, y] in drawings [m]", changes=VALUE),
    ] = None
    scalars: Annotated[
        dict[str, Any],
        ScalarValues(
            "scalar values of the inflow (reservoir, inflow), or at the start (tank, chamber)"
        ),
    ] = {}

    @classmethod
    def own_places(cls, given: dict[str, Any]) -> tuple[str, ...] | None:
        """Names of the places that replace the node, as in the case file; None if the node itself is a place."""
        return None

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        """Names of the bodies that carry the node or move its walls, as in the case file."""
        return ()

    def inner(self, name: str) -> tuple[dict[str, "Node"], dict[str, Any]]:
        """(places, links) of the solved network for this node, each by name.

        They contain the node itself, and its own places `NAME.PLACE`.
        """
        return {name: self}, {}


class PlaceOnBody(Node):
    """Node that a body may carry."""

    on: Annotated[
        str | None, Text("body that carries the node; fixed in the world if left out")
    ] = None
    at: Annotated[
        tuple[float, ...] | None,
        Rows(
            "position",
            length=3,
            about="position (of a basin: of its origin) in axes of the body, instead of `elevation` [m]; 0 if left out",
        ),
    ] = None

    @classmethod
    def bodies(cls, given: dict[str, Any]) -> tuple[str, ...]:
        return (given["on"],) if isinstance(given.get("on"), str) else ()

    @property
    def position_keys(self) -> dict[str, Any]:
        """Keys of the position of the node, with their values."""
        return {"elevation": self.elevation, "on": self.on, "at": self.at}

    @property
    def place(self) -> tuple[float, ...]:
        """Position [m] of the node in the axes of its body; the origin if not given."""
        return self.at or (0.0, 0.0, 0.0)


class Link(Part):
    """Part with ports that join places; flow is positive into the part at each port.

    The sum of potential times flow over the ports is the power [W] into the part. Potential and flow are pressure and
    volume flow (hydraulic domain), velocity and force (translational), angular velocity and torque (rotational), or
    voltage and current (electrical). The flow of the thermal domain is a heat flow, itself a power.
    """

    noun: ClassVar[str] = "link"
    kinds: ClassVar[Kinds] = Kinds()
    quantities: ClassVar[dict[str, str]] = {"flow": "flow"}
    # quantities that are recorded only by explicit probes
    on_request: ClassVar[tuple[str, ...]] = ()
    along: ClassVar[dict[str, str]] = {}  # quantities that also exist at a fraction of the length
    joins: ClassVar[dict[str, str]] = {}  # port -> required domain of its place
    # keys of hydraulic places that it only senses, as TABLE.KEY in a table
    sensed_keys: ClassVar[tuple[str, ...]] = ()
    # True if it is an element of a network of rotation, electricity or heat
    in_network: ClassVar[bool] = False
    # its only ports in such a network, if it is a part of the fluid too
    network_ports: ClassVar[tuple[str, ...]] = ()
    # quantities that are recorded where a case has no probes
    main_quantities: ClassVar[tuple[str, ...]] = ()
    # True if it determines the pressures at its ends, by its free surface
    fixes_pressure: ClassVar[bool] = False
    may_lack: ClassVar[tuple[str, ...]] = ()  # ports that may join nothing
    owns: ClassVar[dict[str, str]] = {}  # own place, `LINK.PLACE` for other parts -> domain

    @property
    def network_places(self) -> tuple[str, ...]:
        """Places of its ports that its elements in a network of potential and flow join."""
        return tuple(
            place
            for port, place in self.ports.items()
            if port in self.network_ports or self.in_network and self.joins.get(port) != "hydraulic"
        )

    @property
    def words(self) -> tuple[str, ...]:
        return (*super().words, *(["element of a network"] if self.network_places else []))

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, "Link"]]:
        """(places, links) of the solved network for this link, each by name.

        They contain the link itself, and its own places `NAME.PLACE`.
        """
        return {}, {name: self}


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

    joins: ClassVar[dict[str, str]] = {
        "from": "translational or spatial",
        "to": "translational or spatial",
    }
    quantities: ClassVar[dict[str, str]] = {"force": "force"}


@dataclass(frozen=True)
class Ports(Value):
    """Value of a case file for the key `ports` of a link with other ports than `from` and `to`: port name -> place."""

    names: tuple[str, ...]
    about: str = "place of each port"

    def read(self, given: Any, setting: ReadContext) -> dict[str, str]:
        example = ", ".join(f'{name} = "..."' for name in self.names)
        check_table(given, f"{{ {example} }}")
        return read_keys(given, self.keys(), setting)

    def keys(self) -> dict[str, tuple[Value, Any]]:
        return {name: (Text(), NEEDED) for name in self.names}

    @property
    def takes(self) -> str:
        return f"`{{ {', '.join(self.names)} }}`"

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys())


def is_kind(part: Any, kind: str) -> bool:
    """True if a part or class of parts has the type `kind`, without the import of its class; False for None."""
    return getattr(part, "kind", "") == kind


def kind_text(part: Any) -> str:
    """Type of a part, with the number of its equal machines before it: "3 x pump"."""
    count = getattr(part, "count", 1)
    return f"{count} x {part.kind}" if count > 1 else part.kind


def is_in_network(kind: Any) -> bool:
    """True if a part, or class of parts, is in networks of rotation, electricity and heat, which carry no scalars."""
    return getattr(kind, "in_network", False) or getattr(kind, "domain", "") in NETWORK_DOMAINS
