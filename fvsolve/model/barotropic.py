"""The starting profile under laws that are not linear. Knows what the linear start lacks."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.kernels import density as kernels
from fvsolve.kernels import records as rec
from fvsolve.kernels.barotropic_nodes import drive, end_flow, valve_target
from fvsolve.kernels.density.profile import profile_along
from fvsolve.model.start import PRESSURE_SCALE, Start


class BarotropicStart(Start):
    """Potentials are rho_ref (h(p) + g z); what densities change in drops is lagged until nothing moves."""

    def __init__(self, draft) -> None:
        super().__init__(draft)
        self.st, self.floats = draft.tables.settings[0], draft.tables.floats
        self.rho = draft.fluid.density
        self.jets = {name: self.jet(row, *2 * [self.rho * float(row["area"])]) for name, row in
                     zip(draft.pipe_names, self.pipes, strict=True)}  # fmt: skip
        self.end_flow = end_flow
        if self.law.cavitates:
            from fvsolve.kernels.cavitating_nodes import end_flow_cavitating

            self.end_flow = end_flow_cavitating

    def solve(self) -> None:
        before = None
        for _ in range(80):
            super().solve()
            now = np.concatenate((self.answer.potential / PRESSURE_SCALE, self.answer.flow / self.flow_scale))
            scale = 1 + np.max(np.abs(now), initial=0.0)  # masses alone have no unknowns here
            moves = np.full(now.size, np.inf) if before is None else np.abs(now - before) / scale
            if np.max(moves, initial=0.0) <= 1e-14:
                return
            before = now
            self.correct()
        if np.max(moves) > 1e-9:
            draft, worst = self.draft, int(np.argmax(moves))
            names = [*self.case.places, *draft.pipe_names, *draft.column_names, *draft.valve_names, *self.case.links]
            draft.fault("numerics.initial", f"no steady state was found: {names[worst]} moves with the densities; "
                        'look at the heads around it, or use initial = "rest"')  # fmt: skip
            self.draft.check()

    def jet(self, row, m_from: float, m_to: float) -> tuple[float, float]:
        """What a pipe's flow M loses over M^2 [Pa s2/kg2] where it leaves at its `from` end and at its `to` end.

        rho / (2 m^2), m [kg/m] the mass per length there; none where nothing is at rest.
        """
        ends = ((int(row["from_node"]), m_from), (int(row["to_node"]), m_to))
        back, ahead = (0.5 * self.rho / m**2 if self.still(i) else 0.0 for i, m in ends)
        return back, ahead

    def still(self, i: int) -> bool:
        return self.nodes["kind"][i] != rec.JUNCTION

    def correct(self) -> None:
        """What drops differ from those of a constant density, at the present answer."""
        potential = self.answer.potential
        names = self.draft.pipe_names
        for k, (row, mesh) in enumerate(zip(self.pipes, self.draft.meshes, strict=True)):
            flow, i, j = float(self.pipe_flow[k]), int(row["from_node"]), int(row["to_node"])
            row["flow"] = flow
            row["drag"] = self.pipe_drop(row)
            b_to = self.march(row, mesh, flow)[2]
            if not math.isfinite(b_to):
                self.draft.fault(f"links.{names[k]}", "no steady state: its pressure falls below what the density law "
                                 'can hold; look at the heads at its ends, or use initial = "rest"')  # fmt: skip
                self.draft.check()
            lost = 0.5 * (flow / self.ends[1]) ** 2 if flow > 0.0 and self.still(j) else 0.0
            self.jets[names[k]] = self.jet(row, *self.ends)
            plain = row["drag"] / row["area"] * mesh.length + self.jets[names[k]][flow > 0.0] * abs(flow) * flow
            self.extra[names[k]] = (potential[i] - self.rho * (b_to - lost)) - plain if flow != 0.0 else 0.0
        for k, row in enumerate(self.valves):
            i, j = int(row["from_node"]), int(row["to_node"])
            denser, wider = self.denser(i, j)
            self.dense_of[k], self.factor[k], self.ratio[k] = (denser, wider), denser * wider, wider
        for k, row in enumerate(self.pistons):
            self.factor[len(self.valves) + k] = self.dense(int(row["a"]), int(row["b"]))

    def dense(self, i: int, j: int) -> float:
        """(upstream density / rho)(driving pressure / change of potential)."""
        denser, wider = self.denser(i, j)
        return denser * wider

    def denser(self, i: int, j: int) -> tuple[float, float]:
        """Upstream density / rho, driving pressure / change of potential."""
        z, p = self.nodes["elevation"], [self.pressure(i), self.pressure(j)]
        drop, rho = drive(self.st, self.floats, p[0], z[i], p[1], z[j])
        change = self.answer.potential[i] - self.answer.potential[j]
        ratio = drop / change if abs(change) > 1e-3 else rho / self.rho
        return rho / self.rho, ratio

    def march(self, row, mesh, flow: float):
        """(mass per length at faces, at centres, Bernoulli constant at the `to` end) of a pipe's profile."""
        i = int(row["from_node"])
        z = float(self.nodes["elevation"][i])
        start = self.answer.potential[i] / self.rho
        if flow < 0.0 and self.still(i):
            m, _ = kernels.mass_of_pressure(self.st, self.floats, row, self.pressure(i))
            start += 0.5 * (flow / m) ** 2
        faces, centers = np.zeros(mesh.cells + 1), np.zeros(mesh.cells)
        b_to = profile_along(
            self.st, self.floats, self.draft.tables.profile, row, float(start), z, flow, faces, centers
        )
        self.ends = faces[0], faces[-1]
        return faces, centers, b_to

    def match(self, row, mesh, flow: float):
        """The profile that ends at the pressure of its `to` node; what friction does not hold of it drives the flow."""
        j = int(row["to_node"])
        for sweep in range(20):
            faces, centers, b_to = self.march(row, mesh, flow)
            leaves = 0.5 * (flow / faces[-1]) ** 2 if flow > 0.0 and self.still(j) else 0.0
            short = self.answer.potential[j] - self.rho * (b_to - leaves)
            if sweep == 0 and not self.drive_pipe(mesh, row, self.pipe_drop(row) / row["area"] * mesh.length - short):
                break
            if abs(short) <= 1e-9 * PRESSURE_SCALE:
                break
            if sweep > 0:
                row["drag"] -= short * row["area"] / mesh.length
        return faces, centers

    def fill_pipes(self) -> None:
        profile, self.driven = self.draft.tables.profile, {}
        for k, (row, mesh) in enumerate(zip(self.pipes, self.draft.meshes, strict=True)):
            flow = row["flow"] = float(self.pipe_flow[k])
            row["drag"] = self.pipe_drop(row)
            faces, centers = self.match(row, mesh, flow)
            n = mesh.cells
            profile[row["face"] : row["face"] + n + 1] = faces
            profile[row["center"] : row["center"] + n] = centers
            for m0, name, sign in ((faces[0], "from", -1.0), (faces[-1], "to", 1.0)):
                i = int(row[f"{name}_node"])
                into, _, mass = self.end_flow(self.st, self.floats, row, m0, sign * flow,
                                         float(self.nodes["pressure"][i]), bool(self.still(i)))  # fmt: skip
                near = abs(into - sign * flow) <= 1e-7 * (self.flow_scale * 1e-3 + abs(flow))
                row[f"{name}_base"] = into if near else sign * flow
                row[f"{name}_mass"] = mass if near else m0
            boiling, _ = kernels.mass_of_pressure(self.st, self.floats, row, self.law.cavity_pressure)
            profile[row["cell"] : row["cell"] + n] = row["speed"] * (boiling - centers)
            self.draft.profiles[k] = np.array([self.pressure_of_mass(row, m) for m in centers])
            self.flux(row, faces, profile)

    def flux(self, row, faces, profile) -> None:
        from fvsolve.kernels.barotropic import momentum_flux

        for i, m in enumerate(faces):
            profile[row["flux"] + i] = momentum_flux(self.st, self.floats, row, float(m), float(row["flow"]))

    def pressure_of_mass(self, row, m: float) -> float:
        return kernels.pressure_of_mass(self.st, self.floats, row, float(m))

    def profile_at(self, k: int, fraction: float) -> tuple[float, float]:
        row, mesh = self.pipes[k], self.draft.meshes[k]
        return self.pressure_of_mass(row, self.mass_at(k, fraction)), self.height(row, mesh, fraction)

    def mass_at(self, k: int, fraction: float) -> float:
        """Mass per length of the profile at a fraction of pipe k, linear between faces and centres."""
        row, mesh = self.pipes[k], self.draft.meshes[k]
        profile, n = self.draft.tables.profile, mesh.cells
        both = np.empty(2 * n + 1)
        both[0::2], both[1::2] = (
            profile[row["face"] : row["face"] + n + 1],
            profile[row["center"] : row["center"] + n],
        )
        m = float(np.interp(fraction, np.linspace(0.0, 1.0, 2 * n + 1), both))
        return m if row["rise"] < 0 else self.leant(row, mesh, fraction, m)

    def leant(self, row, mesh, fraction: float, m: float) -> float:
        """Mass per length of a place between faces and centres, which may lie above or below their straight line."""
        rises = self.draft.tables.profile[row["rise"] : row["rise"] + 2 * mesh.cells + 1]
        straight = np.interp(fraction, np.linspace(0.0, 1.0, rises.size), rises)
        higher = mesh.profile.at(fraction * mesh.length) - mesh.profile.elevation[0] - straight
        p = self.pressure_of_mass(row, m)
        p -= self.law.density(p) * self.case.gravity * higher
        return float(kernels.mass_of_pressure(self.st, self.floats, row, float(p))[0])

    def fill_columns(self) -> None:
        for row, flow in zip(self.columns, self.column_flow, strict=True):
            row["flow"] = flow
            i, j = int(row["from_node"]), int(row["to_node"])
            row["drag"] = self.pipe_drop(row)
            z, p = self.nodes["elevation"], self.nodes["pressure"]
            row["base"] = drive(self.st, self.floats, p[i], z[i], p[j], z[j])[0]
            pull = row["drag"] * row["length"] / row["area"]
            change = self.answer.potential[i] - self.answer.potential[j]
            offset = row["base"] - pull
            small = 1e-10 * (PRESSURE_SCALE + abs(change)) + abs(row["base"] - change)
            row["offset"] = offset if abs(offset) > small else 0.0

    def drive_of(self, k: int) -> tuple[float, float]:
        i, j = int(self.valves[k]["from_node"]), int(self.valves[k]["to_node"])
        p, z = self.nodes["pressure"], self.nodes["elevation"]
        drop, rho = drive(self.st, self.floats, p[i], z[i], p[j], z[j])
        return drop, rho / self.rho

    def fill_valves(self) -> None:
        for k, (row, flow) in enumerate(zip(self.valves, self.valve_flow, strict=True)):
            row["flow"] = flow
            row["drop"] = self.answer.potential[row["from_node"]] - self.answer.potential[row["to_node"]]
            if row["hooks"] >= 0:
                self.lowered(k).follow(self, k)
            elif row["open"] > 0.0:
                target = valve_target(self.draft.tables, self.out, k, float(row["open"]))[0]
                asked = target if row["transition"] > 0.0 else np.sign(target) * np.sqrt(abs(target))
                if abs(asked - flow) > 1e-6 * (self.flow_scale * 1e-6 + abs(flow)):
                    row["open"] = 0.0
