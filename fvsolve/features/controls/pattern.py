"""States on which blocks of `controls` depend, for the sparsity pattern of the Jacobian."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fvsolve.core.assembly.features import FeaturePattern
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.state_pairs import pairs_of, unique_states


class BlockCouplings(FeaturePattern):
    """States of blocks, and states on which their outputs and rates depend. model : `Couplings` of the model"""

    def __init__(self, feature, couplings) -> None:
        super().__init__(feature)
        tables = couplings.model.tables
        self.model, self.tables, self.controls = couplings, tables, feature.table
        self.sensors, self.floats, self.size = feature.sensor_table, tables.floats, couplings.size
        self.follows = {
            index: int(tables.pieces[row["first"], 2])
            for index, row in enumerate(tables.schedules)
            if row["pieces"] == 0
        }
        counts = np.diff([*(row["y"] for row in self.controls if row["y"] >= 0), self.size])
        ends = iter(counts)
        self.counts = [int(next(ends)) if row["y"] >= 0 else 0 for row in self.controls]
        self.at_once: dict[int, np.ndarray] = {}

    def own(self, k: int) -> np.ndarray:
        """States of block k."""
        return self.controls[k]["y"] + np.arange(self.counts[k])

    def inputs(self, k: int) -> list[int]:
        """Inputs of block k: number of a sensor, or -1 - number of another block."""
        row = self.controls[k]
        return self.tables.integers[row["inputs"] :][: row["input_count"]].tolist()

    def output(self, k: int) -> np.ndarray:
        """States on which the output of block k depends: its own, and those of inputs that it passes on at once."""
        if k not in self.at_once:
            row = self.controls[k]
            parts = [self.own(k), self.schedule(row["setpoint"])] if row["period"] == 0.0 else []
            parts += [self.read(code) for code in self.inputs(k)] if row["at_once"] else []
            self.at_once[k] = unique_states(*parts)
        return self.at_once[k]

    def schedule(self, *indices: int) -> np.ndarray:
        """States on which schedules depend that follow blocks; empty for other schedules."""
        return unique_states(
            *(self.output(self.follows[index]) for index in indices if index in self.follows)
        )

    def read(self, code: int) -> np.ndarray:
        """States on which an input depends."""
        return self.output(-1 - code) if code < 0 else self.sensor(self.sensors[code])

    def sensor(self, row) -> np.ndarray:
        """States on which the value of a sensor depends."""
        model = self.model
        kind = row["kind"]
        i = int(row["index"])
        for own in model.features:
            if (states := own.probe(row)) is not None:
                return states
        if kind == rec.LEVEL or (kind == rec.PRESSURE and not model.inner[i]):
            return unique_states(
                model.pressure_states(i), self.schedule(model.nodes[i]["schedule"])
            )
        if kind == rec.PRESSURE:
            return model.sets[i]
        for own in model.features:
            if (states := own.probe(row)) is not None:
                return states
        if kind == rec.VALVE_FLOW:
            link = model.valves[i]
            ends = (model.sets[link[end]] for end in ("from_node", "to_node"))
            return unique_states(*ends, model.opening_states(link))
        if kind == rec.DEVICE_VALUE:
            rows = model.parts[i][2]
            if rows.quantities[row["side"]] in rows.states:
                return model.device_states(model.devices[i])
            return model.device_reading(model.devices[i])
        if kind in (rec.PIPE_PRESSURE, rec.PIPE_FLOW) and model.pipes[i]["cells"] > 0:
            pipe, right = model.pipes[i], int(row["side"] > 0)
            if row["side"] != 0:
                node = pipe["to_node" if right else "from_node"]
                return unique_states(model.edge_cells(pipe, right), model.sets[node])
            cells = pipe["y"] + row["cell"] + np.arange(row["count"])
            return unique_states(cells, cells + pipe["cells"])
        return np.arange(self.size)

    def pairs(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield couplings (rates, states) of the states of blocks, and of rates that blocks drive directly."""
        for k, row in enumerate(self.controls):
            read = [
                self.own(k),
                self.schedule(row["setpoint"]),
                *(self.read(code) for code in self.inputs(k)),
            ]
            yield pairs_of(self.own(k), unique_states(*read))
        tables = self.tables
        network = {*self.tables.valves["schedule"], *self.tables.nodes["schedule"]}
        network |= {*tables.valves["command"]}
        network |= {*tables.devices["schedule"], *self.controls["setpoint"]}
        network |= {index for own in self.model.features for index in own.schedules()}
        other = [index for index in self.follows if index not in network]  # shafts, scalars
        if other:
            yield pairs_of(np.arange(self.size), self.schedule(*other))
