"""Pipes whose flow follows their losses at once: a pipe with `pipe_model = "quasi-steady"`."""

from collections.abc import Iterator
from typing import Any, ClassVar

from fvsolve.parts.pipe.part import QUASI_STEADY, Pipe
from fvsolve.parts.table_model import CaseContext, Faults


class QuasiSteadyPipe(Pipe, pipe_model=QUASI_STEADY):
    """A pipe without inertia and waves: p + rho g z drops by L / A times the drag of the mass flow M at every moment.

    The drag is that of the friction and the minor losses of the pipe, L its length, A its area, p the pressure, z the
    elevation and rho the density. p + rho g z is linear along the axis. Ports: from, to. Stored energy: none.
    Dissipated power: drop of p + rho g z times flow [W].
    """

    kind: ClassVar[str] = "quasi-steady-pipe"
    type_in_file: ClassVar[str] = "pipe"
    quantities: ClassVar[dict[str, str]] = {"flow": "flow"}
    on_request: ClassVar[tuple[str, ...]] = ()
    own_scalars: ClassVar[str] = ""
    no_scalars: ClassVar[str] = (
        'it has no volume to carry scalars; use pipe_model = "finite-volume", or "fvsolve quality" for water age'
    )

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        # short pipes stand for losses
        yield from (found for found in super().unusual() if found[0] != ("diameter",))

    def faults(self, name: str, around: CaseContext) -> Faults:
        yield from super().faults(name, around)
        law, model = self.friction, self.friction.model
        follows = '"quasi-steady" friction, whose factor follows the present flow'
        if model == "unsteady":
            text = '"unsteady" depends on waves, and a quasi-steady pipe has none'
            yield ("friction", "model"), f"{text}; expected {follows}"
        elif model == "steady" and law.factor is None:
            text = '"steady" takes the factor of the initial flow, and a quasi-steady pipe has no flow of its own'
            yield ("friction", "model"), f"{text}; expected {follows}, or `factor`"
        elif self.minor_loss == 0.0 and (model == "none" or law.factor == 0.0):
            text = "is missing: the flow of a quasi-steady pipe follows its losses, and this pipe has none"
            yield (
                ("friction",),
                f'{text}; give `friction` or `minor_loss`, or use type = "rigid-column"',
            )
        if self.initial_flow is not None:
            text = "a quasi-steady pipe has no flow of its own, its flow follows the pressures; leave this key out"
            yield ("initial_flow",), text
        ends = [around.nodes.get(end) for end in (self.from_, self.to)]
        if any(getattr(node, "on", None) is not None for node in ends):
            text = '"quasi-steady" has no inertia, and this pipe is on a body, whose acceleration acts on its water'
            yield ("pipe_model",), f'{text}; expected "finite-volume"'
