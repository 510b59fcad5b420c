"""Bodies in the tables of a model, as probes read them."""

from __future__ import annotations

from fvsolve.kernels import records as rec
from fvsolve.model.lowering import Lowering


class BodyRows(Lowering, kind="body"):
    """What moves in space."""

    def probe(self, draft, name, probe, row) -> None:
        from fvsolve.kernels.mechanism.observe import BODY_QUANTITIES  # scenes without bodies load none of it

        which = "angle" if probe.quantity == "travel" else probe.quantity
        row["kind"], row["side"] = rec.BODY_VALUE, BODY_QUANTITIES.index(which)
        row["index"] = draft.body_names.index(name)
