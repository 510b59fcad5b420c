"""Initial steady state under density laws that are not linear."""

import math

import numpy as np

from fvsolve.core.kernels import density as kernels
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.barotropic_nodes import end_flow
from fvsolve.core.kernels.density.steady_profile import profile_along
from fvsolve.core.kernels.restrictions import driving_pressure, valve_target
from fvsolve.core.model.steady_start import PRESSURE_SCALE, SteadyStart


class NonlinearStart(SteadyStart):
    """Steady flow with the potentials rho_ref (h(p) + g z) [Pa].

    rho_ref : reference density [kg/m3]; h : specific enthalpy [J/kg]; z : elevation [m]. Effects of density on pressure
    drops are those of the previous solution, until they no longer change.
    """

    def __init__(self, draft) -> None:
        super().__init__(draft)
        self.st, self.floats = draft.tables.settings[0], draft.tables.floats
        self.rho = draft.fluid.density
        self.exit_losses = {
            name: self.jet(row, *2 * [self.rho * float(row["area"])])
            for name, row in zip(draft.pipe_names, self.pipes, strict=True)
        }
        self.end_flow = end_flow
        if self.law.cavitates:
            from fvsolve.core.kernels.cavitating_nodes import end_flow_cavitating

            self.end_flow = end_flow_cavitating

    def solve(self) -> None:
        previous = None
        for _ in range(80):
            super().solve()
            present = np.concatenate(
                (self.answer.potential / PRESSURE_SCALE, self.answer.flow / self.flow_scale)
            )
            # with masses alone there are no unknowns
            scale = 1 + np.max(np.abs(present), initial=0.0)
            changes = (
                np.full(present.size, np.inf)
                if previous is None
                else np.abs(present - previous) / scale
            )
            if np.max(changes, initial=0.0) <= 1e-14:
                return
            previous = present
            self.correct_drops()
        if np.max(changes) > 1e-9:
            draft, worst = self.draft, int(np.argmax(changes))
            names = [
                *self.case.places,
                *draft.pipe_names,
                *draft.column_names,
                *draft.valve_names,
                *self.case.links,
            ]
            draft.fault(
                "numerics.initial",
                f"no steady state was found: {names[worst]} does not converge with "
                'variable density; check the heads around it, or use initial = "rest"',
            )
            self.draft.check()

    def jet(self, row, m_from: float, m_to: float) -> tuple[float, float]:
        """Loss coefficient rho_ref / (2 m^2) of the flow that leaves a pipe at its `from` and `to` end [Pa s2/kg2].

        m_from, m_to : mass per length there [kg/m]. The coefficient times the square of the mass flow is the pressure
        loss; it is 0 at junctions.
        """
        ends = ((int(row["from_node"]), m_from), (int(row["to_node"]), m_to))
        back, ahead = (0.5 * self.rho / m**2 if self.at_rest(i) else 0.0 for i, m in ends)
        return back, ahead

    def at_rest(self, i: int) -> bool:
        return self.nodes["kind"][i] != rec.JUNCTION

    def correct_drops(self) -> None:
        """Set corrections of pressure drops relative to those at constant density, from the latest solution.

        Raises CaseError if the pressure in a pipe falls below the range of the density law.
        """
        potential = self.answer.potential
        names = self.draft.pipe_names
        for k, (row, mesh) in enumerate(zip(self.pipes, self.draft.meshes, strict=True)):
            flow = float(self.pipe_flow[k])
            i = int(row["from_node"])
            j = int(row["to_node"])
            row["flow"] = flow
            row["drag"] = self.pipe_drop(row)
            b_to = self.march(row, mesh, flow)[2]
            if not math.isfinite(b_to):
                self.draft.fault(
                    f"links.{names[k]}",
                    "no steady state: the pressure in this pipe falls below the "
                    "range of the density law; check the heads at its ends, or use "
                    'initial = "rest"',
                )
                self.draft.check()
            exit_loss = 0.5 * (flow / self.ends[1]) ** 2 if flow > 0.0 and self.at_rest(j) else 0.0
            self.exit_losses[names[k]] = self.jet(row, *self.ends)
            jet = self.exit_losses[names[k]][flow > 0.0] * abs(flow) * flow
            constant_density = row["drag"] / row["area"] * mesh.length + jet
            drop = potential[i] - self.rho * (b_to - exit_loss)
            self.extra[names[k]] = drop - constant_density if flow != 0.0 else 0.0
        for k, row in enumerate(self.valves):
            i, j = int(row["from_node"]), int(row["to_node"])
            density_ratio, drive_ratio = self.density_and_drive(i, j)
            self.density_ratios[k], self.ratio[k] = (density_ratio, drive_ratio), drive_ratio
            self.factor[k] = density_ratio * drive_ratio
        for k, row in enumerate(self.leaks):
            self.factor[len(self.valves) + k] = self.dense(int(row["a"]), int(row["b"]))

    def dense(self, i: int, j: int) -> float:
        """Factor on the conductance between nodes i and j, the product of both ratios of `density_and_drive`."""
        density_ratio, drive_ratio = self.density_and_drive(i, j)
        return density_ratio * drive_ratio

    def density_and_drive(self, i: int, j: int) -> tuple[float, float]:
        """Ratios for the flow from node i to j : (upstream density over reference density, driving ratio).

        The driving ratio is the driving pressure over the change of potential; for a negligible change it is the
        density ratio.
        """
        z, p = self.nodes["elevation"], [self.pressure(i), self.pressure(j)]
        drop, rho = driving_pressure(self.st, self.floats, p[0], z[i], p[1], z[j])
        change = self.answer.potential[i] - self.answer.potential[j]
        ratio = drop / change if abs(change) > 1e-3 else rho / self.rho
        return rho / self.rho, ratio

    def march(self, row, mesh, flow: float):
        """Steady state along a pipe, integrated from its `from` end : (masses at faces, masses at centres, constant).

        The masses are per length [kg/m]; those at both ends are also written to `ends`. The constant is h + v^2 / 2 + g
        z at the `to` end [J/kg]; it is not finite if the pressure falls below the range of the density law.
        """
        i = int(row["from_node"])
        z = float(self.nodes["elevation"][i])
        start = self.answer.potential[i] / self.rho
        if flow < 0.0 and self.at_rest(i):
            m, _ = kernels.mass_of_pressure(self.st, self.floats, row, self.pressure(i))
            start += 0.5 * (flow / m) ** 2
        faces, centers = np.zeros(mesh.cells + 1), np.zeros(mesh.cells)
        profile = self.draft.tables.profile
        b_to = profile_along(
            self.st, self.floats, profile, row, float(start), z, flow, faces, centers
        )
        self.ends = faces[0], faces[-1]
        return faces, centers, b_to

    def match(self, row, mesh, flow: float):
        """Steady state along a pipe that ends at the pressure of its `to` node : (masses at faces, at centres).

        The masses are per length [kg/m]. If friction does not balance the pressures of the end nodes, the difference is
        recorded as unbalanced, and the drag in `row` is changed so that the profile ends at the pressure of `to`.
        """
        j = int(row["to_node"])
        for sweep in range(20):
            faces, centers, b_to = self.march(row, mesh, flow)
            exit_loss = 0.5 * (flow / faces[-1]) ** 2 if flow > 0.0 and self.at_rest(j) else 0.0
            shortfall = self.answer.potential[j] - self.rho * (b_to - exit_loss)
            change = self.pipe_drop(row) / row["area"] * mesh.length - shortfall
            if sweep == 0 and not self.set_unbalanced_drop(mesh, row, change):
                break
            if abs(shortfall) <= 1e-9 * PRESSURE_SCALE:
                break
            if sweep > 0:
                row["drag"] -= shortfall * row["area"] / mesh.length
        return faces, centers

    def fill_pipes(self) -> None:
        profile, self.unbalanced_drops = self.draft.tables.profile, {}
        for k, (row, mesh) in enumerate(zip(self.pipes, self.draft.meshes, strict=True)):
            flow = row["flow"] = float(self.pipe_flow[k])
            row["drag"] = self.pipe_drop(row)
            faces, centers = self.match(row, mesh, flow)
            n = mesh.cells
            profile[row["face"] : row["face"] + n + 1] = faces
            profile[row["center"] : row["center"] + n] = centers
            for m0, name, sign in ((faces[0], "from", -1.0), (faces[-1], "to", 1.0)):
                i = int(row[f"{name}_node"])
                inflow, _, mass = self.end_flow(
                    self.st,
                    self.floats,
                    row,
                    m0,
                    sign * flow,
                    float(self.nodes["pressure"][i]),
                    bool(self.at_rest(i)),
                )
                consistent = abs(inflow - sign * flow) <= 1e-7 * (
                    self.flow_scale * 1e-3 + abs(flow)
                )
                row[f"{name}_base"] = inflow if consistent else sign * flow
                row[f"{name}_mass"] = mass if consistent else m0
            vapour_mass, _ = kernels.mass_of_pressure(
                self.st, self.floats, row, self.law.cavity_pressure
            )
            profile[row["cell"] : row["cell"] + n] = row["speed"] * (vapour_mass - centers)
            self.draft.profiles[k] = np.array([self.pressure_of_mass(row, m) for m in centers])
            self.flux(row, faces, profile)

    def flux(self, row, faces, profile) -> None:
        from fvsolve.core.kernels.barotropic_pipes import momentum_flux

        for i, m in enumerate(faces):
            profile[row["flux"] + i] = momentum_flux(
                self.st, self.floats, row, float(m), float(row["flow"])
            )

    def pressure_of_mass(self, row, m: float) -> float:
        return kernels.pressure_of_mass(self.st, self.floats, row, float(m))

    def profile_at(self, k: int, fraction: float) -> tuple[float, float]:
        row, mesh = self.pipes[k], self.draft.meshes[k]
        return self.pressure_of_mass(row, self.mass_at(k, fraction)), self.height(
            row, mesh, fraction
        )

    def mass_at(self, k: int, fraction: float) -> float:
        """Mass per length of the steady state at a fraction of the length of pipe k [kg/m].

        It is linear between faces and centres, and corrected for height by `mass_between` if the pipe is not straight.
        """
        row, mesh = self.pipes[k], self.draft.meshes[k]
        profile, n = self.draft.tables.profile, mesh.cells
        masses = np.empty(2 * n + 1)
        masses[0::2] = profile[row["face"] : row["face"] + n + 1]
        masses[1::2] = profile[row["center"] : row["center"] + n]
        m = float(np.interp(fraction, np.linspace(0.0, 1.0, 2 * n + 1), masses))
        return m if row["rise"] < 0 else self.mass_between(row, mesh, fraction, m)

    def mass_between(self, row, mesh, fraction: float, m: float) -> float:
        """Mass per length [kg/m] at a place between a face and a centre, where the pipe is not straight.

        fraction : distance of the place from the `from` end over the length of the pipe
        m : mass per length by linear interpolation, to be corrected for the height of the pipe above the straight line
        """
        rises = self.draft.tables.profile[row["rise"] : row["rise"] + 2 * mesh.cells + 1]
        straight = np.interp(fraction, np.linspace(0.0, 1.0, rises.size), rises)
        excess = mesh.profile.at(fraction * mesh.length) - mesh.profile.elevation[0] - straight
        p = self.pressure_of_mass(row, m)
        p -= self.law.density(p) * self.case.gravity * excess
        return float(kernels.mass_of_pressure(self.st, self.floats, row, float(p))[0])

    def fill_columns(self) -> None:
        for row, flow in zip(self.columns, self.column_flow, strict=True):
            row["flow"] = flow
            i, j = int(row["from_node"]), int(row["to_node"])
            row["drag"] = self.pipe_drop(row)
            z, p = self.nodes["elevation"], self.nodes["pressure"]
            row["base"] = driving_pressure(self.st, self.floats, p[i], z[i], p[j], z[j])[0]
            friction = row["drag"] * row["length"] / row["area"]
            change = self.answer.potential[i] - self.answer.potential[j]
            offset = row["base"] - friction
            small = 1e-10 * (PRESSURE_SCALE + abs(change)) + abs(row["base"] - change)
            row["offset"] = offset if abs(offset) > small else 0.0

    def valve_drive(self, k: int) -> tuple[float, float]:
        i, j = int(self.valves[k]["from_node"]), int(self.valves[k]["to_node"])
        p, z = self.nodes["pressure"], self.nodes["elevation"]
        drop, rho = driving_pressure(self.st, self.floats, p[i], z[i], p[j], z[j])
        return drop, rho / self.rho

    def fill_valves(self) -> None:
        for k, (row, flow) in enumerate(zip(self.valves, self.valve_flow, strict=True)):
            row["flow"] = flow
            row["drop"] = (
                self.answer.potential[row["from_node"]] - self.answer.potential[row["to_node"]]
            )
            if row["hooks"] >= 0:
                self.valve_lowering(k).follow(self, k)
            elif row["open"] > 0.0:
                target = valve_target(self.draft.tables, self.out, k, float(row["open"]))[0]
                law_flow = (
                    target if row["transition"] > 0.0 else np.sign(target) * np.sqrt(abs(target))
                )
                if abs(law_flow - flow) > 1e-6 * (self.flow_scale * 1e-6 + abs(flow)):
                    row["open"] = 0.0
