"""A force from outside on a body. Knows its course; knows no body."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import Field

from fvsolve.parts.link import Coupling
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Text


class Force(Coupling, kind="force"):
    """force(t) on `to`, forward; as much back on `from`, where there is one.

    Ports: from, to. Stored and dissipated energy: none; it brings force times (v_to - v_from) [W].
    """

    may_lack: ClassVar[tuple[str, ...]] = ("from",)

    from_: Annotated[str | None, Text("the body it pushes itself off from, if any"), Field(alias="from")] = None
    force: Annotated[Schedule, Scheduled("force", about="on `to`, positive forward [N]")]

    @property
    def ports(self) -> dict[str, str]:
        """Port name -> place."""
        return {"to": self.to} if self.from_ is None else super().ports
