"""Rows of the tables of a model for the water of conduits."""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.errors import Notice
from fvsolve.features.basins import tables as records
from fvsolve.features.basins.basin_terms import SHORTAGES
from fvsolve.features.basins.conduit import conduit_rates
from fvsolve.features.basins.conduit.conduit_cells import (
    THIN,
    drag_per_flow,
    fastest,
    velocity_factor,
)
from fvsolve.features.basins.conduit.conduit_rates import OF_AREA, OF_DEPTH, OF_FLOW
from fvsolve.features.basins.conduit.lower_chain import steady_chain
from fvsolve.features.basins.conduit.steady_profile import put_profile
from fvsolve.features.basins.free_surface.lower import COURANT_FACTOR
from fvsolve.features.basins.lower_friction import (
    RowsWithFriction,
    cap_checks,
    run_checks,
    start_notices,
)
from fvsolve.parts.conduit.law import INSIDE, end_flow
from fvsolve.parts.conduit.law_section import (
    area_of,
    celerity,
    depth_of,
    section_at_depth,
    section_of,
)

PACKAGE = __package__
QUANTITIES = {"depth": OF_DEPTH, "head": OF_DEPTH, "filling": OF_AREA, "flow": OF_FLOW}
SMALL = 0.1  # small deviation of the filling, for scales of states
SHALLOW = 0.1  # depth over the diameter up to which a conduit counts as dry at the start


class ConduitWaterRows(RowsWithFriction):
    """Rows of the water of a conduit; states are deviation of the area from rest [m2] and flow [m3/s]."""

    units = {"depth": "m", "surface": "m", "bed": "m", "velocity": "m/s"}
    has_wide_closure = False
    no_fifth_order = "does not support conduits"
    table = "links"

    def __init__(self, case, name: str) -> None:
        super().__init__(case, name)
        self.conduit, self.bed = self.part.conduit, self.part.bed_at_centres()
        self.section = section_of(
            case.gravity, self.conduit.diameter, self.conduit.celerity(case.gravity)
        )
        self.rough = self.conduit.rough(case.gravity)
        self.depth = np.maximum(self.part.level - self.bed, 0.0)
        self.area = self.areas(self.depth)
        self.fades = THIN * self.section.area
        self.full_rate = (
            COURANT_FACTOR * self.conduit.celerity(case.gravity) * self.n / self.conduit.length
        )

    def areas(self, depth: np.ndarray) -> np.ndarray:
        """Areas of cells at their depths : float64[n] [m2]."""
        return np.array([area_of(self.section, h) for h in depth.tolist()])

    def pieces(self, valves: bool) -> Iterator[RhsTerms]:
        yield RhsTerms(
            package=PACKAGE,
            prepare="conduit_rates: read_ends",
            rates="conduit_rates: conduit_rates",
            observe="conduit_rates: observe_conduits",
            damp="conduit_rates: damp_conduits" if self.damped else "",
        )
        yield SHORTAGES

    @property
    def scheme(self) -> str:
        return "upwind" if self.case.numerics.scheme == "upwind" else "muscl"

    @property
    def undivided_reason(self) -> str:
        return "it is a conduit"

    @property
    def deep(self) -> bool:
        return bool(self.scalars)  # the area takes the place of the depth

    def given_value(self, name: str) -> float | None:
        return self.conduit.scalars.get(name)

    def depth_of(self, y: np.ndarray) -> np.ndarray:
        return np.maximum(self.area + y[0], 0.0)

    def mass_per_depth(self) -> np.ndarray:
        return self.mass()[1]

    def end_at_rest(self, patch: str) -> tuple[float, float]:
        """(depth, surface above the level at rest) inside an end of the water at rest."""
        i, inner = (0, 1) if patch == "from" else (-1, -2)
        h, bed = float(self.depth[i]), self.conduit.inverts[i]
        if h > 0.0 and self.n > 1 and self.scheme != "upwind" and self.depth[inner] > 0.0:
            h = 0.5 * (h + max(2.0 * h - float(self.depth[inner]), 0.0))
        return h, 0.0 if h > 0.0 else bed - self.part.level

    def lower(self, draft, row) -> None:
        surface = np.maximum(self.bed - self.part.level, 0.0)
        row["plan"] = draft.to_plane(np.array([self.area, self.depth, surface]))
        # of cells of unit width
        row["area"] = draft.to_plane(np.full(self.n, self.conduit.length / self.n))
        row["table"] = draft.to_plane(np.array(self.section))
        row["work"] = draft.to_work(conduit_rates.WORK + 2 * self.n)
        row["rest"] = self.case.properties.density * self.case.gravity * self.part.level
        row["friction"] = records.MANNING if any(self.rough) else records.NO_DRAG
        row["roughness"] = draft.to_plane(np.array(self.rough))
        row["held"], row["damped"], row["unsplit"] = self.rate_cap, self.damped, COURANT_FACTOR

    def lower_patch(self, draft, patch: str, row) -> None:
        super().lower_patch(draft, patch, row)
        i = 0 if patch == "from" else -1
        level = self.part.level
        row["closure"] = records.LINKED
        row["valve"] = k = draft.valve_names.index(f"{self.name}.{patch}.face")
        row["rest"], row["lowest"] = self.conduit.inverts[i] - level, max(self.bed[i] - level, 0.0)
        row["depth"], row["inside"], row["stencil"] = -1, draft.to_work(INSIDE), 1
        at = int(draft.valve_table[k]["data"]) + len(self.section)
        draft.floats[at : at + 2] = float(row["lowest"]), float(row["inside"])
        row["second"] = len(draft.integers)
        inner = min(1, self.n - 1) if patch == "from" else max(self.n - 2, 0)
        draft.integers.append(inner)

    def scales(self) -> list[float]:
        full = 0.25 * math.pi * self.conduit.diameter**2
        return [SMALL * full, SMALL * full * math.sqrt(self.case.gravity * self.conduit.diameter)]

    def levels_at_start(self) -> list[float]:
        """Levels at both ends at the start [m]: heads of the nodes, where they are above the invert.

        Otherwise it is the level of the water at the other end, at most the invert.
        """
        ends = list(zip(self.steady[1], self.conduit.inverts, strict=True))
        reached = [None if head is None or head <= bed else head for head, bed in ends]
        return [
            head if head is not None else bed if other is None else min(other, bed)
            for head, other, (_, bed) in zip(reached, reached[::-1], ends, strict=True)
        ]

    def start(self, attitude: Any = None) -> np.ndarray:
        conduit, (low, high) = self.conduit, self.levels_at_start()
        depth, flow = self.steady_start
        if conduit.initial_depth is not None:
            depth = np.full(self.n, conduit.initial_depth)
        elif depth is None:
            depth = np.maximum(
                low + (high - low) * (np.arange(self.n) + 0.5) / self.n - self.bed, 0.0
            )
        change = (
            np.zeros(self.n) if np.array_equal(depth, self.depth) else self.areas(depth) - self.area
        )
        return np.array([change, np.where(self.area + change > 0.0, flow, 0.0)])

    def filling_step(self) -> float:
        """Longest explicit step while no wave limits steps, at Courant number 1 [s]; infinite with a deep cell.

        It is the time in which a wave in water as deep as the diameter crosses a cell. Without it the first step into a
        dry conduit would last until the next break of a schedule.
        """
        shallow = float(self.depths(self.start()).max()) <= SHALLOW * self.conduit.diameter
        step = self.conduit.length / self.n / math.sqrt(self.case.gravity * self.conduit.diameter)
        return step if shallow else math.inf

    def greatest_outflow(self, patch, work: np.ndarray) -> float:
        """Critical outflow of an end [m3/s]; patch : its row of the table; work : work array with the state inside."""
        inside = work[patch["inside"] : patch["inside"] + INSIDE]
        return -end_flow(self.section, inside[1] - inside[0], inside)[0]

    def start_flow(self, patch: str) -> float:
        """Flow into the end `patch` at the start [m3/s]."""
        flows = self.start()[1]
        return float(flows[0] if patch == "from" else -flows[-1])

    @cached_property
    def steady(self) -> tuple[float | None, list[float | None]]:
        """(steady flow at the start [m3/s], heads of both nodes then [m]); None if not known."""
        conduit = self.conduit
        flows = {}
        heads = {}
        if self.case.numerics.initial != "rest" and conduit.initial_depth is None:
            flows, heads = steady_chain(self.part.chain, self.case.gravity)
        flow = conduit.initial_flow if conduit.initial_flow is not None else flows.get(self.name)
        places = zip(conduit.ports.values(), self.part.heads, strict=True)
        return flow, [heads.get(place, head) for place, head in places]

    @cached_property
    def steady_start(self) -> tuple[np.ndarray | None, float]:
        """(depths of gradually varied flow in cells [m], None without flow; flow [m3/s]) at the start."""
        conduit, (flow, heads) = self.conduit, self.steady
        if not flow:
            return None, 0.0
        turn = -1 if flow < 0.0 else 1
        (begin, end), lower = conduit.inverts[::turn], heads[::turn][1]
        depth = max(-math.inf if lower is None else lower - end, 0.0)
        depths = np.zeros(self.n + 2)
        put_profile(self.section, abs(flow), self.rough, begin - end, conduit.length, depth, depths)
        return depths[1:-1][::turn].copy(), flow

    def depths(self, y: np.ndarray) -> np.ndarray:
        """Depths of cells at deviations y : float64[n] [m]."""
        return np.array(
            [depth_of(self.section, area) for area in np.maximum(self.area + y[0], 0.0).tolist()]
        )

    def fields(self, y: np.ndarray) -> dict[str, np.ndarray]:
        depth, area = self.depths(y), np.maximum(self.area + y[0], 0.0)
        speed = np.array([velocity_factor(self.section, wet) for wet in area.tolist()]) * y[1]
        velocity = np.column_stack([speed, np.zeros((self.n, 2))])
        return {"depth": depth, "bed": self.bed, "surface": self.bed + depth, "velocity": velocity}

    def speeds(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        fields, waves = self.fields(y), []
        for h, area in zip(fields["depth"].tolist(), (self.area + y[0]).tolist(), strict=True):
            c = celerity(self.section, section_at_depth(self.section, h)[1], area)
            waves.append(fastest(self.section, area, c))
        return fields["velocity"], np.array(waves)

    def friction_in_cells(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        pairs = zip(self.depths(y).tolist(), (self.area + y[0]).tolist(), strict=True)
        per = [drag_per_flow(self.section, self.rough, h, max(area, 0.0)) for h, area in pairs]
        return self.depths(y), np.abs(y[1]), np.array(per) * np.abs(y[1])

    def notices(self, y: np.ndarray) -> list[Notice]:
        return start_notices(self, y, cap_checks(self))

    def watches(self, y: np.ndarray) -> list[Any]:
        return run_checks(self, y, cap_checks(self))

    def ranges(self) -> dict[str, tuple[float, float]]:
        y = self.start()
        depth, speed = self.depths(y), self.speeds(y)[1]
        return {"depth": (depth.min(), depth.max()), "wave_speed": (speed.min(), speed.max())}

    def ground(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        first, last = self.conduit.inverts
        return first + (last - first) * x / self.conduit.length

    def lower_probe(self, row, field: str, cells: np.ndarray, weights: np.ndarray) -> None:
        row["side"], row["scale"] = QUANTITIES[field], 1.0
        if field == "filling":
            row["scale"] = 1.0 / (0.25 * math.pi * self.conduit.diameter**2)
        elif field == "head":
            row["offset"] = float(weights @ self.bed[cells])

    def at_rest(self) -> np.ndarray:
        return self.area

    def mass(self) -> tuple[float, np.ndarray]:
        per = np.full(self.n, self.case.properties.density * self.conduit.length / self.n)
        return float(np.sum(per * self.area)), per

    def weights(self, y: np.ndarray) -> np.ndarray:
        per = 0.5 * self.mass()[1]
        area = np.maximum(self.area + y[0], 1e-6 * self.section.area)
        width = np.array([section_at_depth(self.section, h)[1] for h in self.depths(y).tolist()])
        return np.array(
            [per * self.case.gravity / np.maximum(width, self.section.slot), per / area]
        )
