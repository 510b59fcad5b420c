"""Scalars of a case that the flow carries, with their reactions and the heat of the fluid."""

from __future__ import annotations

import copy
from collections.abc import Iterator

import numpy as np

from fvsolve.core.assembly.features import Feature, FeatureRun
from fvsolve.core.assembly.lowering import VALUE, Input, lowering_of
from fvsolve.core.assembly.scheme_codes import lower_position
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.core.model.probe_tables import cells_at_point, fill_probes
from fvsolve.features.scalars import lower, reactions
from fvsolve.features.scalars.kernels import terms
from fvsolve.features.scalars.kernels.tables import EMPTY, ScalarTables
from fvsolve.parts.nodes_and_links import is_in_network

REACTION_QUANTITIES = ("rate", "power", "affinity")  # in the order of `kernels.tables`
SENSED = (rec.NODE_SCALAR, rec.PIPE_SCALAR)


class Scalars(Feature, slot=2, wakes="section scalars, section reactions"):
    """Scalars, reactions and heat of a case.

    heat_rows : rows in the ledger of the heat of restrictions and pipes; arrays : see `kernels.tables`
    """

    def __init__(self, case, given_up=()) -> None:
        super().__init__(case, given_up)
        self.scalars, self.heat_sources, self.exchangers, self.reactions = EMPTY
        self.heat_rows, self.reads_masses = 0, bool(case.scalars)

    def tables(self) -> ScalarTables:
        """Tables as compiled functions read them."""
        return ScalarTables(self.scalars, self.heat_sources, self.exchangers, self.reactions)

    def lower_behind_meshes(self, draft) -> None:
        lower.lower_scalars(draft, self)
        reactions.lower_reactions(draft, self)

    def lower_last(self, draft) -> None:
        lower.lower_exchangers(draft, self)

    def reserve_ledger(self, draft) -> None:
        lower.reserve_scalars(draft, self)
        reactions.reserve_reactions(draft, self)

    def reserve(self, draft) -> None:
        for pipe in draft.pipe_table:
            if pipe["temperature"] > 0.0:
                pipe["present"] = draft.to_work(int(pipe["cells"]))

    def settle(self, draft) -> list[str]:
        lower.scale_scalars(draft, self)
        return []

    def start(self, draft, y: np.ndarray) -> None:
        lower.start_amounts(draft, self, y)

    def close(self, draft) -> None:
        for table in self.tables():
            table.flags.writeable = False

    def copy_for(self, case) -> Scalars:
        own = copy.copy(self)
        own.case = case
        own.scalars, own.heat_sources, own.exchangers, own.reactions = map(np.copy, self.tables())
        return own

    def probe(self, draft, probe, row) -> bool:
        case = draft.case
        if probe.part == "reactions":
            self.reaction_probe(draft, row, probe)
            return True
        part = {**case.links, **case.conduits}.get(probe.name)
        part = {**case.places, **case.nodes}.get(probe.name) if probe.part == "nodes" else part
        if probe.quantity not in case.scalars or probe.part == "sections" or is_in_network(part):
            return False
        if probe.part == "nodes" and (
            probe.name in case.lumped or (probe.name in case.meshes and probe.point is None)
        ):
            return False
        row["scalar"] = list(case.scalars).index(probe.quantity)
        if probe.point is not None:
            row["kind"] = rec.CELL_SCALAR
            cells_at_point(draft, row, probe)
        elif probe.part == "nodes":
            row["kind"], row["index"] = rec.NODE_SCALAR, draft.node_index[draft.inside(probe.name)]
        elif probe.name in case.meshes:
            lowering_of(type(case.links[probe.name])).probe(draft, probe.name, probe, row)
        else:  # interpolated linearly between cell centres
            row["kind"], row["index"] = rec.PIPE_SCALAR, draft.pipe_names.index(probe.name)
            lower_position(draft, row, probe.fraction, 1)
        return True

    def reaction_probe(self, draft, row, probe) -> None:
        """Fill the row of a probe of a reaction; of an affinity at a place with the data of a scalar probe there."""
        place = probe.place
        if place is not None:
            of_scalar = fill_probes(draft, [place])[0]
            for key in ("side", "cell", "count", "weights"):
                row[key] = of_scalar[key]
            row["kind"], row["head"], row["scalar"] = (
                rec.LOCAL_AFFINITY,
                of_scalar["kind"],
                of_scalar["index"],
            )
        else:
            row["kind"], row["side"] = rec.REACTION_VALUE, REACTION_QUANTITIES.index(probe.quantity)
        row["index"] = list(draft.case.reactions).index(probe.name.removeprefix("reactions."))

    # model ----------

    def terms(self, model, cast) -> Iterator[tuple[str, RhsTerms]]:
        linear, pipes = cast.family == "linear", model.tables.pipes
        heated = bool((self.scalars["specific_heat"] > 0.0).any())
        if any(
            row["kind"] in SENSED for feature in model.features for row in feature.probe_rows()[0]
        ):
            if heated:
                yield "solved", terms.HEAT_FOR_EVENTS[linear]
            yield "solved", terms.VALUES_FOR_EVENTS
        if (pipes["present"] >= 0).any():
            yield "first", terms.REYNOLDS
        if len(self.scalars):
            yield "carried", terms.AMOUNTS
            if not cast.alone:
                yield "carried", terms.MIXED
            if cast.pipes:
                yield "carried", terms.CARRIED
            if heated:
                yield "carried", terms.HEAT[linear]
            if cast.pipes and (pipes["temperature"] > 0.0).any():
                yield "carried", terms.VISCOSITY
        if len(self.reactions):  # those in basins are added later
            yield "carried", terms.REACTIONS

    def run(self, run_data) -> FeatureRun:
        return ScalarRun(self, run_data)

    def inputs(self, model) -> dict[str, Input]:
        inputs = {}
        for i, (place, node) in enumerate(model.case.places.items()):
            for q, (name, row) in enumerate(zip(model.case.scalars, self.scalars, strict=True)):
                schedule = int(model.tables.integers[row["places"] + i])
                if node.own_scalars == "inflow" and schedule >= 0:
                    inputs[f"{place}.{name}"] = Input(VALUE, schedule, bounds=(self.slot, q))
        return inputs

    def held(self, tables, t: float, smooth: bool) -> tuple[Scalars, dict[str, np.ndarray]]:
        if not smooth:
            return self, {}
        own, bounds = self.to_hold()
        bounds["least"], bounds["greatest"] = -np.inf, np.inf
        return own, {}

    def to_hold(self) -> tuple[Scalars, np.ndarray]:
        own = copy.copy(self)
        own.scalars = self.scalars.copy()
        bounds = own.scalars[:]  # this view stays writable
        own.scalars.flags.writeable = False
        return own, bounds

    def pattern(self, couplings):
        from fvsolve.features.scalars.pattern import ScalarPattern

        return ScalarPattern(self, couplings)

    def modes(self, model) -> list:
        from fvsolve.features.scalars.modes import basin_scalar_modes, pipe_scalar_modes

        return (
            pipe_scalar_modes(model) + basin_scalar_modes(model) + reactions.reaction_modes(model)
        )

    def weigh(self, model, weights: np.ndarray, y: np.ndarray) -> None:
        from fvsolve.features.scalars.weights import weigh_scalars

        weigh_scalars(model, weights)

    def add_fields(self, fields: dict, model, y: np.ndarray, out: np.ndarray) -> None:
        from fvsolve.features.scalars.balances import node_values, pipe_values

        for k, pipe in enumerate(model.pipes):
            fields[pipe.name] |= pipe_values(model, k, y)
        for i, name in enumerate(model.node_names):
            fields["nodes"][name] |= node_values(model, i, out)

    def facts(self, model) -> dict:
        return {"reactions": reactions.reaction_facts(model)}

    def check_texts(self, model, facts: dict) -> list[str]:
        return [
            f"reaction {name}: {item['equation']}, rate {item['law']} [mol/m3/s]; {item['rate']:.4g} mol/s at the start"
            for name, item in facts["reactions"].items()
        ]

    def stored_states(self, model) -> np.ndarray:
        from fvsolve.features.scalars.balances import amount_indices

        return amount_indices(model)

    def bounds(self, model) -> list[tuple[np.ndarray, np.ndarray]]:
        from fvsolve.features.scalars.bounds import scalar_bounds

        # limits of single amounts would break sums that reactions keep
        reacting = reactions.reacting(model.case)
        names = [(q, name) for q, name in enumerate(model.case.scalars) if name not in reacting]
        return [row for q, _ in names for row in scalar_bounds(model, q)]

    def ledgers(self, model, y: np.ndarray, ledger: np.ndarray) -> dict[str, dict]:
        from fvsolve.features.scalars.balances import scalar_ledgers

        return scalar_ledgers(model, y, ledger)


class ScalarRun(FeatureRun):
    """Heat in a run."""

    def explanation(self, status: int, index: int, out: np.ndarray) -> dict:
        """Names of the source of heat that finds no coolant, and of the node at its outlet."""
        if status != rec.NO_COOLANT:
            return {}
        from fvsolve.features.scalars.kernels.scalar_transport import GREATEST_RISE

        model = self.run_data.model
        k = self.feature.heat_sources[index]["valve"]
        end = "from_node" if out[model.layout["valve"] + k] < 0.0 else "to_node"
        names = {
            "part": model.valve_names[k],
            "name": model.node_names[model.tables.valves[k][end]],
        }
        return names | {"rise": GREATEST_RISE}
