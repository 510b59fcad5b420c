"""What lies between nodes and carries flow. Knows what every link has; knows no node but by name."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.table import Table
from fvsolve.parts.value import Text


class Link(Table):
    """A part with two ports, `from` and `to`; its flow [m3/s] is positive into it at `from`.

    Each port joins a place; potential times flow, summed over the ports, is the power [W] it takes up.
    """

    kind: ClassVar[str] = ""
    kinds: ClassVar[dict[str, type[Link]]] = {}
    quantities: ClassVar[dict[str, str]] = {"flow": "flow"}
    along: ClassVar[dict[str, str]] = {}  # quantities that also exist at a fraction of the length

    from_: Annotated[str, Text("the place it starts from"), Field(alias="from")]
    to: Annotated[str, Text("the place it leads to")]

    @property
    def ports(self) -> dict[str, str]:
        """Port name -> place."""
        return {"from": self.from_, "to": self.to}

    def __init_subclass__(cls, kind: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        cls.kind = kind
        Link.kinds[kind] = cls
