"""Energy of small deviations of masses and bodies as sums of squares, see `model.energy_norm`.

Energy of a small deviation from the state y:
velocities v of bodies with mass matrix M : v' M v / 2; that of a mass, m v^2 / 2, is among the weights
elongation s of a spring, of a stop in contact, or of the spring of a joint, stiffness k : k s^2 / 2
excess mass e [kg] and travel x in a chamber of a cylinder : dp/dm (e - x A e0 / V)^2 / (2 rho), with piston area A,
volume V and excess mass e0 at y
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fvsolve.core.assembly.lowering import rows_in
from fvsolve.features.motion.kernels.tables import motion_of
from fvsolve.features.motion.static_forces import mass_factor


def spring_rows(model, y: np.ndarray, elongations: Elongations):
    """Yield (name, state -> factor) of each row of L for springs, and for stops in contact."""
    braces, stops = rows_in(model.case, "brace"), rows_in(model.case, "stop")
    for k, ((name, *_), row) in enumerate(zip(braces, motion_of(model).brace_table, strict=True)):
        if row["stiffness"] > 0.0:
            yield (
                name,
                elongations.by(
                    k, row["from_mass"], row["to_mass"], float(np.sqrt(0.5 * row["stiffness"]))
                ),
            )
    for k, ((name, *_), row) in enumerate(
        zip(stops, motion_of(model).stop_table, strict=True), len(braces)
    ):
        x = elongations.travel(k)
        if row["below"] + x < 0.0 or x > row["above"]:
            yield (
                name,
                elongations.by(
                    k, row["from_mass"], row["to_mass"], float(np.sqrt(0.5 * row["stiffness"]))
                ),
            )


def chamber_rows(model, y: np.ndarray, elongations: Elongations):
    """Yield (index of the mass state, state -> factor) of the row of L for each chamber of cylinders at y.

    The same excess mass e [kg] in less volume has more pressure. If the cylinder joins points of bodies, the mass state
    is e plus the gained volume times the density at the start.
    """
    nodes, pistons = model.tables.nodes, motion_of(model).piston_table
    per_mass = elongations.out[int(model.layout["stiffness"]) :]
    first = len(motion_of(model).brace_table) + len(motion_of(model).stop_table)
    for k, row in enumerate(pistons, first):
        x = elongations.travel(k)
        for name, sign in (("a", 1.0), ("b", -1.0)):
            node = nodes[row[name]]
            area = sign * float(row[f"area_{name}"])
            sweep = float(row[f"sweep_{name}"])
            at, volume = int(node["y"]), float(node["volume"] + area * x)
            excess = float(y[at]) - (sweep * x if row["line"] >= 0 else 0.0)
            excess_ratio = excess / volume  # excess density, relative to that of the start
            root = float(np.sqrt(per_mass[node["row"]] / (2.0 * (sweep / area + excess_ratio))))
            per_travel = excess_ratio * area + (sweep if row["line"] >= 0 else 0.0)
            moved = (
                elongations.by(k, row["case"], row["rod"], -root * per_travel) if per_travel else {}
            )
            yield at, {at: root} | moved


class Elongations:
    """Elongations of force elements (springs, stops, cylinders) at a state, and their derivatives by states.

    out : values that the right-hand side writes in addition to dydt
    """

    def __init__(self, model, y: np.ndarray) -> None:
        self.model, self.y = model, y
        self.t = model.case.numerics.start
        self.out = model.evaluate(self.t, y)[1]
        self.first = int(model.layout["travel"])

    def travel(self, k: int) -> float:
        """Elongation of force element k [m]."""
        return float(self.out[self.first + 2 * k])

    def by(self, k: int, i: int, j: int, factor: float) -> dict[int, float]:
        """Derivatives of `factor` times the elongation of force element k : state -> derivative.

        i, j : masses that it joins; equal if it joins points of bodies
        """
        places = motion_of(self.model).mass_table["y"]
        if i != j:
            return {
                int(places[m]): sign * factor for m, sign in ((i, -1.0), (j, 1.0)) if places[m] >= 0
            }
        return {
            at: factor * float(row[2 * k]) for at, row in self.slopes.items() if row[2 * k] != 0.0
        }

    @cached_property
    def slopes(self) -> dict[int, np.ndarray]:
        """Derivatives of elongations by joint coordinates : state -> float64[2 k].

        The values are those of the elongation and its rate for each of the k force elements.
        """
        tables, slopes = motion_of(self.model), {}
        last = self.first + 2 * (
            len(tables.brace_table) + len(tables.stop_table) + len(tables.piston_table)
        )
        for body in tables.body_table:
            count = int(body["freedoms"]) + (body["freedoms"] >= 3)
            for at in range(int(body["y"]), int(body["y"]) + count):
                step = 1e-6 * (self.model.scale[at] + abs(self.y[at])) * 1e2
                high, low = self.y.copy(), self.y.copy()
                high[at], low[at] = high[at] + step, low[at] - step
                ends = [self.model.evaluate(self.t, y)[1][self.first : last] for y in (high, low)]
                slopes[at] = (ends[0] - ends[1]) / (high[at] - low[at])
        return slopes


def kinetic_rows(model, y: np.ndarray):
    """Yield (name, state -> factor) of each row of L for the kinetic energy of bodies.

    The energy is v' M v / 2 = |F v|^2 / 2: velocities v, mass matrix M = F' F with the factor F from the kernels.
    """
    motion = motion_of(model)
    bodies = motion.body_table
    freedoms = motion.freedom_table
    n = len(motion.freedom_table)
    if not n:
        return
    factor = mass_factor(model, y)[8 * n :]
    rate = [int(body["rate"]) + k for body in bodies for k in range(body["freedoms"])]
    names = [
        name
        for name, body in zip(motion.body_names, bodies, strict=True)
        for _ in range(body["freedoms"])
    ]
    for name, row in zip(names, freedoms, strict=True):
        path = model.tables.integers[row["path"] : row["path"] + row["depth"] + 1]
        entries = np.sqrt(0.5) * factor[row["row"] : row["row"] + row["depth"] + 1]
        yield name, {rate[j]: float(entry) for j, entry in zip(path, entries, strict=True)}


def joint_spring_rows(model):
    """Yield (name, state -> factor) of the row of L for each spring of a joint."""
    for name, body in zip(motion_of(model).body_names, motion_of(model).body_table, strict=True):
        if body["stiffness"] > 0.0:
            yield name, {int(body["y"]): float(np.sqrt(0.5 * body["stiffness"]))}
