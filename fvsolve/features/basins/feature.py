"""Basins of a case: parts with cells in a plane, and conduits."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.core.assembly import lowering
from fvsolve.core.assembly.features import Feature, FeatureRun
from fvsolve.core.assembly.model_draft import aligned_zeros
from fvsolve.features.basins import lower
from fvsolve.features.basins.tables import DISCHARGE, EMPTY, STAGE, BasinTables
from fvsolve.features.scalars.own_tables import scalar_tables

# functions of the loads on bodies of water at rest, and of water at rest on moving walls
LOADS_AT_REST = ("basin_frames: set_frames", "frame_forces: add_frame_forces")
WALL_LOADS = ("moving_walls: push_bodies_at_rest",)
PACKAGE = "fvsolve.features.basins"
# closure of a patch -> key of its input, and kind of the input
INPUTS = {DISCHARGE: ("discharge", lowering.FLOW), STAGE: ("stage", lowering.STAGE)}


class Basins(Feature, slot=4, wakes="kind basin, kind conduit"):
    """Basins of a case.

    meshed : `BasinRows` of each, in the order of their table; wall_names : names of moving walls, BASIN.PATCH
    basins, patches, walls : see `tables`
    """

    def __init__(self, case, given_up=()) -> None:
        super().__init__(case, given_up)
        self.meshed: list[Any] = []
        self.basins, self.patches, self.walls, *_ = EMPTY
        self.wall_names: list[str] = []

    def tables(self) -> BasinTables:
        """Tables as compiled functions read them, without scalars."""
        return EMPTY._replace(basins=self.basins, patches=self.patches, walls=self.walls)

    # build ----------

    def lower_behind_nodes(self, draft) -> None:
        lower.lower_basins(draft, self)

    def probe(self, draft, probe, row) -> bool:
        from fvsolve.features.basins.lower_probes import lower_probe

        return lower_probe(draft, self, probe, row)

    def change_settings(self, draft, settings) -> None:
        if draft.case.patches_with_faces:
            from fvsolve.features.basins.free_surface.patch_closures import DEEPEST

            settings["unmarked"] = (
                settings["vapor"]
                - 0.5 * DEEPEST * draft.case.properties.density * draft.case.gravity
            )

    def reserve(self, draft) -> None:
        lower.reserve_basins(draft, self)

    def start(self, draft, y: np.ndarray) -> None:
        lower.start_basins(self.meshed, y)
        draft.warnings += [
            notice for basin in self.meshed for notice in basin.notices(basin.deviations(y))
        ]

    def level(self, draft, y: np.ndarray, attitudes=None) -> list[str]:
        names = list(WALL_LOADS) if (self.walls["body"] >= 0).any() else []
        if any(basin.row["frame"] >= 0 for basin in self.meshed):
            lower.start_basins(self.meshed, y, None if attitudes is None else attitudes())
            names = [*LOADS_AT_REST, *names]
        return [f"{PACKAGE}.{name}" for name in names]

    def close(self, draft) -> None:
        for table in (self.basins, self.patches, self.walls):
            table.flags.writeable = False

    def copy_for(self, case) -> Basins:
        own = copy.copy(self)
        own.case = case
        return own

    # model ----------

    @property
    def damped(self) -> bool:
        return any(basin.row["damped"] for basin in self.meshed)

    @property
    def sources(self) -> list[str]:
        return [f"{basin.name}.{name}" for basin in self.meshed for name in basin.source_names]

    def terms(self, model, cast) -> Iterator:
        from fvsolve.features.basins.basin_terms import terms_of_basins, terms_of_scalars

        for terms in terms_of_basins(self.meshed, cast.valves):
            yield "flow", terms
        for terms in terms_of_scalars(self.meshed):
            yield "cells", terms

    def run(self, run_data) -> FeatureRun:
        return BasinRun(self, run_data)

    def pattern(self, couplings):
        from fvsolve.features.basins.pattern import BasinPattern

        return BasinPattern(self, couplings)

    def cell_states(self, model) -> list[np.ndarray]:
        from fvsolve.features.basins.lower_pattern import all_states

        # every cell's volume follows these
        walls = [[at for at, _, _ in basin.stretches] for basin in self.meshed]
        return [*(all_states(basin) for basin in self.meshed), *walls]

    def weigh(self, model, weights: np.ndarray, y: np.ndarray) -> None:
        for basin in self.meshed:
            basin.states_of(weights)[:] = basin.weights(basin.deviations(y))

    def masses(self, model, y: np.ndarray) -> Iterator[tuple[float, float]]:
        for basin in self.meshed:
            rest, per = basin.mass()
            for own, start in zip(
                basin.states_of(y)[:1], basin.states_of(model.start)[:1], strict=True
            ):
                yield rest + float(np.sum(per * start)), float(np.sum(per * (own - start)))

    def book_sources(self, y: np.ndarray, ledger: np.ndarray) -> None:
        sources = [(basin, name) for basin in self.meshed for name in basin.source_names]
        for k, (basin, name) in enumerate(sources):
            # from its heights, whose sum needs no exchange between threads at every stage
            if name == "infiltration":
                ledger[1, k] = -basin.mass_in_soil(y)

    def open_nodes(self, model) -> set[int]:
        return {int(row["node"]) for row in self.patches if row["open"]}

    def inputs(self, model) -> dict[str, lowering.Input]:
        found = {}
        for row in self.patches:
            key, sort = INPUTS.get(int(row["closure"]), ("", None))
            if key:
                found[f"{model.node_names[row['node']]}.{key}"] = lowering.Input(
                    sort, int(row["drive"])
                )
        return found

    def driven(self) -> set[int]:
        return {int(k) for k in self.walls["schedule"]}

    def held(self, tables, t: float, smooth: bool) -> tuple[Basins, dict[str, np.ndarray]]:
        if not any(row["period"] > 0.0 for row in self.basins):
            return self, {}
        # given velocities that reverse periodically
        own, basins, plane = copy.copy(self), self.basins.copy(), tables.plane.copy()
        for basin, row in zip(self.meshed, basins, strict=True):
            if row["period"] > 0.0:
                grid = basin.mesh.grid
                faces = (
                    grid.ny * (grid.nx + 1) + (grid.ny + 1) * grid.nx
                    if basin.is_grid
                    else basin.mesh.left.size
                )
                factor = np.cos(np.pi * t / row["period"])
                plane[row["flows"] : row["flows"] + faces] *= factor
                row["fastest"], row["period"] = abs(factor) * row["fastest"], 0.0
        basins.flags.writeable = False
        own.basins = basins
        return own, {"plane": plane}

    def energy_refusal(self) -> str:
        from fvsolve.features.basins.accounts import energy_refusal

        return energy_refusal(self.case, self)

    def end_accounts(self, accounts) -> None:
        from fvsolve.features.basins.accounts import end_accounts

        end_accounts(accounts, self)

    def add_fields(self, fields: dict, model, y: np.ndarray, out: np.ndarray) -> None:
        for basin in self.meshed:
            fields[basin.name] = basin.fields(basin.deviations(y)) | (
                basin.values(y) if basin.scalars else {}
            )
            if basin.moves or basin.part.on is not None:
                fields["points"][basin.name] = basin.points_at(y, out, model.layout)

    def facts(self, model) -> dict[str, Any]:
        from fvsolve.features.basins.facts import basin_facts

        return {"basins": {basin.name: basin_facts(basin) for basin in self.meshed}}


class BasinRun(FeatureRun):
    """Tables in a run. basins : that of basins, a copy for each run, because studies of energy change it"""

    def __init__(self, feature: Basins, run_data) -> None:
        super().__init__(feature, run_data)
        self.basins = feature.basins.copy()

    def tables(self, view: str = "") -> BasinTables:
        carried = scalar_tables(self.run_data.model)
        return self.feature.tables()._replace(
            basins=self.basins, scalars=carried.scalars, reactions=carried.reactions
        )

    def written_tables(self) -> dict[str, np.ndarray]:
        tables = self.run_data.model.tables
        if not any(basin.moves or basin.row["frame"] >= 0 for basin in self.feature.meshed):
            return {}
        plane = aligned_zeros(tables.plane.size)
        plane[:] = tables.plane
        return {"plane": plane}

    def for_energy(self) -> None:
        self.basins["loads_body"] = 1

    def critical_outflows(self, i: int) -> list[float]:
        tables = self.run_data.tables
        work = self.run_data.written.work
        found = []
        patches = self.feature.patches
        for patch in patches[patches["valve"] >= 0]:
            basin = self.feature.meshed[patch["basin"]]
            if tables.valves["from_node"][patch["valve"]] == i and hasattr(
                basin, "greatest_outflow"
            ):
                found.append(basin.greatest_outflow(patch, work))
        return found

    def held_marks(self, start: float, t: float, entered: np.ndarray) -> list:
        if not np.isin(self.feature.patches["closure"], lower.HELD).any():
            return []
        from fvsolve.features.basins.held_discharges import held_discharges

        return held_discharges(self.run_data, self.feature.patches, start, t, entered)
