"""Probes of rigid bodies in the tables of a model."""

from __future__ import annotations

from fvsolve.kernels import dtypes as rec
from fvsolve.model.lowering import Lowering


class BodyRows(Lowering, kind="body"):
    """Conversion to table rows of the probes of rigid bodies in space."""

    def probe(self, draft, name, probe, row) -> None:
        from fvsolve.kernels.mechanism.body_values import BODY_QUANTITIES  # not loaded by models without bodies

        quantity = "angle" if probe.quantity == "travel" else probe.quantity
        row["kind"], row["side"] = rec.BODY_VALUE, BODY_QUANTITIES.index(quantity)
        row["index"] = draft.body_names.index(name)
