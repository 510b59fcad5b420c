"""States on which networks depend, for the sparsity pattern of the Jacobian."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fvsolve.core.assembly.features import FeaturePattern
from fvsolve.core.model.state_pairs import pairs_of, unique_states
from fvsolve.parts import law_elements as codes


class NetworkCouplings(FeaturePattern):
    """States on which the rows of a network depend. couplings : `Couplings` of the model"""

    def __init__(self, feature, couplings) -> None:
        super().__init__(feature)
        self.couplings, self.network = couplings, feature.network
        self.source_table, self.switches = feature.source_table, feature.switches

    def pairs(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield couplings of the stores of networks with each other, and with what their sources follow."""
        network = self.network
        for r, place in enumerate([*network.states.values(), *network.integrals.values()]):
            yield pairs_of(unique_states(place), self.states_of(network.columns_of_rows[r]))

    def states_of(self, columns: set[int]) -> np.ndarray:
        """States on which a linear function of stores and sources of a network depends."""
        network = self.network
        own = [network.states[column] for column in columns if column in network.states]
        return unique_states(
            *own, *(self.source_states(j) for j in network.inputs_of_columns(columns))
        )

    def row_states(self, row: int) -> np.ndarray:
        """States on which a row of a network depends."""
        return self.states_of(self.network.columns_of_rows[row])

    def read_by(self, part, lowering) -> np.ndarray:
        shaft = lowering.turns_with(part)
        return unique_states() if shaft is None else self.row_states(self.network.node_row(shaft))

    def probe(self, row) -> np.ndarray | None:
        if row["kind"] != codes.NETWORK_VALUE:
            return None
        network, r = self.network, int(row["index"])
        if row["side"] == codes.LOCKED:
            return unique_states()
        if r >= network.rows.integrals:
            return unique_states(list(network.integrals.values())[r - network.rows.integrals])
        rows = [r, *([int(row["cell"])] if row["side"] in (codes.POWER, codes.ENTROPY) else [])]
        return self.states_of(set().union(*(network.columns_of_rows[r] for r in rows)))

    def source_states(self, j: int) -> np.ndarray:
        """States on which a source of a network depends."""
        row = self.source_table[j]
        network = self.network
        model = self.couplings
        i = int(row["index"])
        if row["kind"] == codes.SCHEDULE_INPUT:
            return model.schedule(i)
        if row["kind"] == codes.DEVICE_INPUT:
            return model.device_reading(model.devices[i])
        for own in model.features:
            if (states := own.source(row)) is not None:
                return states
        stores = {column for column in network.columns_followed(j) if column in network.states}
        switch = int(self.switches[i]["schedule"]) if row["kind"] == codes.FRICTION_FLOW else -1
        return unique_states(*(network.states[column] for column in stores), model.schedule(switch))
