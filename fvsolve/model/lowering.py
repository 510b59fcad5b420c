"""How parts become rows of tables: what each kind answers while a model is made. Knows drafts; knows no rhs."""

from __future__ import annotations

import functools
import math
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import Any, ClassVar

from fvsolve.kernels import calls
from fvsolve.kernels.restrictions import step_at
from fvsolve.steady import Edge

SCALE = 1e5  # a typical drop [Pa]


class Lowering:
    """Parts of one kind that carry the fluid: their rows, their numbers, how they start.

    law : module of its compiled law, whose functions are named as `kernels.calls.HOOKS`; with a `step` it says what its
    restriction lets through, in place of the root
    events : what it means that each event function falls to zero, "" where that is nothing to a reader
    acts : whether it is a device as well, see `model.device`
    """

    kinds: ClassVar[dict[str, Lowering]] = {}
    law: ClassVar[ModuleType]
    events: ClassVar[tuple[str, ...]] = ()
    acts: ClassVar[bool] = False

    def __init_subclass__(cls, kind: str = "") -> None:
        if kind:
            Lowering.kinds[kind] = cls()

    def of(self, part: Any) -> Lowering:
        """What lowers this part: itself, but where its keys ask for other states."""
        return self

    def restriction(self, draft, name: str, link: Any, row) -> None:
        """Fill the VALVE row of a link."""
        draft.restriction(name, link, row)

    def numbers(self, draft, name: str, part: Any) -> list[float]:
        """Its numbers, in the order in which its law reads them from the place that its row names as `data`."""
        return []

    def edge(self, start, k: int) -> Edge | None:
        """Its edge in the steady problem, k its VALVE row; None for that of a root, open as `start.shut` has it."""
        row, (denser, wider) = start.valves[k], start.dense_of.get(k, (1.0, 1.0))
        row["open"] = g = start.conductance(k)
        i, j = int(row["from_node"]), int(row["to_node"])
        if g <= 0.0:
            return Edge(i, j, None, 0.0, shut=True)
        if start.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        per, step = math.sqrt(SCALE / (g * denser)), self.stepper(start, k, g, denser)

        def newton(flow, present):
            a, s = step(flow, present * wider)
            return per, per * s * wider, per * a

        return Edge(i, j, newton, math.sqrt(g * denser * SCALE))

    def stepper(self, start, k: int, g: float, denser: float):
        """(flow [kg/s], drop [Pa]) -> a, s of its law's `step`, before anything has happened."""
        hook = calls.addressed(self.law.step, calls.HOOKS["step"][0])
        return lambda flow, drop: step_at(hook, start.out, start.handle, k, g, float(flow), float(drop), denser)

    def follow(self, start, k: int) -> None:
        """Let the profile's drop be that at which it carries its flow; where that is another one, it is not open."""
        row, (drop, denser) = start.valves[k], start.drive_of(k)
        if row["open"] <= 0.0:
            return
        flow, step = float(row["flow"]), self.stepper(start, k, float(row["open"]), denser)
        a, s = step(flow, drop)
        if abs(a) > 1e-6 * (start.flow_scale * 1e-6 + abs(flow)):
            row["open"] = 0.0
        elif start.case.law.linear:
            for _ in range(ROUNDS):
                if s <= 0.0 or a == 0.0:
                    break
                drop -= a / s
                a, s = step(flow, drop)
            row["drop"] = drop

    def resists(self, part: Any) -> bool:
        """Whether its restriction dissipates drop times flow; else that is energy supplied."""
        return True


ROUNDS = 5  # of Newton from a drop that is right to 1e-6


@functools.cache
def lowering_of(part: type) -> Lowering | None:
    """What lowers parts of a kind that have a law of their own: of the module `lower` beside theirs; None of others."""
    home = part.__module__.rpartition(".")[0]
    if find_spec(f"{home}.lower") is not None:
        import_module(f"{home}.lower")
    return Lowering.kinds.get(part.kind)
