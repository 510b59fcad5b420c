"""Rows of the tables of a model for a liquid between two plates, which deviates from rest at a given pressure.

Riemann invariants under the density law `table` are tables for compiled functions. The mass in a fixed volume changes
by d ln rho = (1 / (rho a^2) + compliance) dp: speed of sound a of the fluid, and compliance of elastic walls as in
pipes [1/Pa].
"""

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np

from fvsolve.core.fluid.laws import TableLaw
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.features.basins import mesh_blocks
from fvsolve.features.basins.basin_terms import FRAME_FORCES, SHORTAGES
from fvsolve.features.basins.cell_sides import STEEPEST
from fvsolve.features.basins.liquid import liquid_mesh, liquid_sides
from fvsolve.features.basins.liquid.liquid_patches import PRESSURE
from fvsolve.features.basins.liquid.riemann_invariants import HEAD
from fvsolve.features.basins.lower_basin import BasinRows

REFINEMENT = 4  # intervals of the kernels' tables per interval of the fluid
LEAST_INTERVALS = 512  # least number of intervals over the range of the fluid
MAX_STRETCH = 2.0  # greatest ln(rho / rho at rest) by compliant walls
PANELS = 8  # panels of the integral per interval of the fluid


class RiemannInvariants:
    """Invariant w = integral of c / rho d rho from rest at `pressure` [Pa], c^2 = dp / drho, and related quantities.

    The range of pressures is that of the fluid's table, extended by its length at both ends with constant
    compressibility. It ends earlier where the compliance of walls alone gives abs(ln(rho / rho at rest)) = MAX_STRETCH,
    because equal steps of density must resolve the neighbourhood of rest.

    wave_speed : wave speed at rest including walls [m/s], None for the speed of sound of the fluid
    density, speed : density [kg/m3] and wave speed [m/s] at rest; compliance : compliance of the walls [1/Pa]
    """

    def __init__(self, fluid, pressure: float, wave_speed: float | None = None) -> None:
        from scipy.interpolate import CubicHermiteSpline

        settings, floats = np.zeros(1, rec.SETTINGS), []
        TableLaw.lower(fluid, settings[0], floats)
        n, start, step = (settings[0][key] for key in ("table_size", "table_start", "table_step"))
        knots = start + step * np.arange(n)
        value = np.array(floats[:n])
        slope = np.array(floats[n : 2 * n])
        extension, self.rest, self.interval_count = knots[-1] - knots[0], pressure, 3 * int(n - 1)
        self.ends = min(knots[0], pressure) - extension, max(knots[-1], pressure) + extension
        below, above = self.ends[0] - knots[0], self.ends[1] - knots[-1]
        self.strain = CubicHermiteSpline(  # ln(rho / rho_ref) of the fluid over pressure
            np.concatenate([self.ends[:1], knots, self.ends[1:]]),
            np.concatenate([[value[0] + slope[0] * below], value, [value[-1] + slope[-1] * above]]),
            np.concatenate([slope[:1], slope, slope[-1:]]),
        )
        self.compressibility = self.strain.derivative()
        own = float(self.compressibility(pressure))
        self.density = fluid.density * math.exp(self.strain(pressure))
        self.fluid_speed = 1.0 / math.sqrt(own * self.density)
        self.speed = wave_speed or self.fluid_speed
        compliance = 1.0 / (self.density * self.speed**2) - own
        self.compliance = compliance if compliance > 1e-9 * own else 0.0
        extension = MAX_STRETCH / self.compliance if self.compliance > 0.0 else math.inf
        self.ends = max(self.ends[0], pressure - extension), min(self.ends[1], pressure + extension)

    def stretch(self, p):
        """ln(rho / rho at rest) at a pressure p [Pa]."""
        return self.strain(p) - self.strain(self.rest) + self.compliance * (p - self.rest)

    def deviation(self, p):
        """Density at a pressure p [Pa] minus density at rest [kg/m3]."""
        return self.density * np.expm1(self.stretch(p))

    def impedance(self, p):
        """Density times wave speed [kg/(m2 s)] at a pressure p [Pa]."""
        return np.sqrt(
            self.density * np.exp(self.stretch(p)) / (self.compressibility(p) + self.compliance)
        )

    def pressure(self, deviation: np.ndarray) -> np.ndarray:
        """Pressure [Pa] at deviations of density from rest [kg/m3], by Newton iteration."""
        target = np.log1p(deviation / self.density)
        p = np.interp(target, self.stretch(self.grid), self.grid)
        for _ in range(4):
            p = p - (self.stretch(p) - target) / (self.compressibility(p) + self.compliance)
        return p

    @cached_property
    def grid(self) -> np.ndarray:
        """Pressures [Pa] that divide the range into intervals of integration, including the pressure at rest."""
        return np.unique(
            np.append(np.linspace(*self.ends, PANELS * self.interval_count + 1), self.rest)
        )

    @cached_property
    def invariant(self):
        """Spline of w [m/s] over pressure [Pa], integrated with six Gauss points per interval of `grid`."""
        from scipy.interpolate import CubicHermiteSpline

        nodes, weights = np.polynomial.legendre.leggauss(6)
        half = 0.5 * np.diff(self.grid)
        places = self.grid[:-1, None] + half[:, None] * (1.0 + nodes)
        w = np.append(0.0, np.cumsum(half * ((1.0 / self.impedance(places)) @ weights)))
        return CubicHermiteSpline(
            self.grid, w - w[self.grid == self.rest], 1.0 / self.impedance(self.grid)
        )

    def pressure_of(self, w: np.ndarray) -> np.ndarray:
        """Pressure [Pa] at the invariant w [m/s], by Newton iteration."""
        p = np.interp(w, self.invariant(self.grid), self.grid)
        for _ in range(4):
            p = p - (self.invariant(p) - w) * self.impedance(p)
        return p

    def table(self) -> np.ndarray:
        """Table that `basins.liquid.riemann_invariants` reads : float64[:]."""
        per_r, first_r, r = self.places(self.deviation(np.array(self.ends)))
        per_w, first_w, w = self.places(self.invariant(np.array(self.ends)))
        p, q = self.pressure(r), self.pressure_of(w)
        density_of_r, density_of_w = self.density + r, self.density + self.deviation(q)
        of_r = cubics(self.invariant(p), self.impedance(p) / density_of_r**2 / per_r, first_r)
        of_w = [
            cubics(self.deviation(q), density_of_w**2 / self.impedance(q) / per_w, first_w),
            cubics(q - self.rest, self.impedance(q) / per_w, first_w),
        ]
        head = [per_r, first_r, r.size - 2, HEAD, per_w, first_w, w.size - 2, HEAD + of_r.size]
        return np.concatenate([head, of_r.ravel(), np.hstack(of_w).ravel()])

    def places(self, ends) -> tuple[float, int, np.ndarray]:
        """Uniform grid of multiples of a step between two ends: (1 / step, number of the first multiple, grid points).

        The step is the distance of the ends over the number of intervals of the table.
        """
        step = (ends[1] - ends[0]) / max(REFINEMENT * self.interval_count, 3 * LEAST_INTERVALS)
        first = math.ceil(ends[0] / step)
        return 1.0 / step, first, step * np.arange(first, math.floor(ends[1] / step) + 1)


def cubics(value: np.ndarray, slope: np.ndarray, first: int) -> np.ndarray:
    """Coefficients of a cubic in s from 0 to 1 for each interval between n points : float64[n - 1, 4], constant first.

    value : values at the points; slope : slopes there, as change per interval
    In the first and the last interval the cubic is the tangent at the inner point.
    first : number of the first point (0 or negative); point 0 is at rest, and its value is set to exactly 0
    """
    value[-first] = 0.0
    (f, g), (d, e) = ((both[:-1], both[1:]) for both in (value, slope))
    coefficients = np.column_stack([f, d, 3.0 * (g - f) - 2.0 * d - e, 2.0 * (f - g) + d + e])
    coefficients[0], coefficients[-1] = (g[0] - e[0], e[0], 0.0, 0.0), (f[-1], d[-1], 0.0, 0.0)
    return coefficients


PACKAGE = __package__
PRESSURE_SCALE = 1e5  # [Pa]
STEPS = 8  # midpoint steps up to the height of a cell; the error of each is the cube of its strain
SMALL = 1e-9  # negligible velocity over the wave speed


class LiquidRows(BasinRows):
    """Rows of the tables of a model for a liquid with bulk modulus K and wave speed a.

    States are deviation of density rho - rho0 [kg/m3] and mass flows per area along x and y [kg/(m2 s)]. Under the
    density law `linear`, p = a^2 (rho - rho0). Under `log`, p = K ln(rho / rho0). The laws `log` and `table` have the
    full momentum flux.
    """

    units = {"pressure": "Pa", "velocity": "m/s"}
    banded = banded_mesh = True
    steepest = STEEPEST

    def __init__(self, case, name: str) -> None:
        super().__init__(case, name)
        fluid = case.properties
        self.linear, self.waves = case.law.linear, None
        if case.law.tabulated:
            self.waves = RiemannInvariants(fluid, self.part.pressure, self.part.wave_speed)
            self.density, self.speed = self.waves.density, self.waves.speed
            return
        strain = (self.part.pressure - fluid.pressure) / fluid.bulk_modulus
        self.density = fluid.density * (1.0 if self.linear else math.exp(strain))
        self.speed = self.part.wave_speed or math.sqrt(fluid.bulk_modulus / self.density)

    def pieces(self, valves: bool) -> Iterator[RhsTerms]:
        yield RhsTerms(package=PACKAGE, rates=self.rates())
        law = "_table" if self.waves is not None else ""
        yield RhsTerms(
            package=PACKAGE,
            prepare=f"liquid_patches: patch_pressures{law}",
            boundary_inflow="liquid_patches: patch_flows",
            observe=f"liquid_patches: observe_liquid{law}",
            power="liquid_energy: add_power",
            stored="liquid_energy: add_stored",
        )
        if self.part.on is not None:
            yield FRAME_FORCES
        if self.moves:
            yield RhsTerms(
                package=PACKAGE,
                power="liquid_energy: add_wall_power",
                stored="liquid_energy: add_wall_stored",
            )
        yield SHORTAGES

    def rates(self) -> str:
        """Name of the compiled function that computes the rates of the cells, as `module: function`."""
        law = "table" if self.waves is not None else "linear" if self.linear else "log"
        mesh = "grids" if self.is_grid else "meshes"
        kind = (
            f"moving_{mesh}"
            if self.moves
            else mesh
            if self.part.on is None
            else f"{mesh}_on_bodies"
        )
        return f"liquid_rates: {law}_{kind}"

    @property
    def has_constant_speed(self) -> bool:
        return self.linear and not self.moves

    @property
    def forms_stages(self) -> bool:
        return self.is_grid and self.linear and not self.undivided_reason

    def scales(self) -> list[float]:
        return [
            PRESSURE_SCALE / self.speed**2,
            PRESSURE_SCALE / self.speed,
            PRESSURE_SCALE / self.speed,
        ]

    def reflection(self, patch) -> float:
        if patch.impedance is None:
            return super().reflection(patch)
        own = self.density * self.speed
        return (patch.impedance - own) / (patch.impedance + own)

    def reflections(self) -> np.ndarray:
        coefficients, mesh = super().reflections(), self.mesh
        if self.is_grid:
            return coefficients
        ends = {place for link in self.case.links.values() for place in link.ports.values()}
        linked = [name for name in mesh.patches if f"{self.name}.{name}" in ends]
        if linked and coefficients.size == 0:
            coefficients = np.ones(mesh.left.size - mesh.inner)
        for name in linked:
            own = coefficients[
                mesh.patch(name).start - mesh.inner : mesh.patch(name).stop - mesh.inner
            ]
            own[own == 1.0] = liquid_mesh.LINKED
        return coefficients

    def lower(self, draft, row) -> None:
        row["thickness"], row["speed"], row["density"] = (
            self.part.thickness,
            self.speed,
            self.density,
        )
        height = self.case.properties.density * self.case.gravity * (self.part.elevation or 0.0)
        row["rest"] = self.part.pressure - self.case.ambient_pressure + height
        row["small"] = (SMALL * self.speed * (self.density if self.linear else 1.0)) ** 2
        if self.part.on is not None:
            row["plan"] = draft.to_plane(np.full(self.n, self.density))
        if self.waves is not None:
            self.lower_waves(draft, row)
        if self.is_grid:
            row["work"] = draft.to_work(liquid_sides.work_size(self.mesh.grid.nx))
        else:
            row["work"] = draft.to_work(mesh_blocks.work_size(liquid_mesh, self.integers))

    def lower_waves(self, draft, row) -> None:
        """Append the table of Riemann invariants of the liquid to the arrays of the model (density law `table`).

        A fault is added if the wave speed is greater than the speed of sound, because walls can only reduce it.
        """
        if self.waves.speed > (1.0 + 1e-9) * self.waves.fluid_speed:
            speed, sound = (
                draft.case.amount(value, "velocity", 6)
                for value in (self.speed, self.waves.fluid_speed)
            )
            draft.fault(
                f"nodes.{self.name}.wave_speed",
                f"{speed} is faster than sound in the fluid, {sound}; "
                "expected at most that speed, or another density law",
            )
        row["table"] = draft.to_plane(self.waves.table())

    def pressure(self, deviation: np.ndarray) -> np.ndarray:
        """Pressure above the pressure at rest [Pa] at deviations of density from rest [kg/m3]."""
        if self.linear:
            return self.speed**2 * deviation
        if self.waves is not None:
            return self.waves.pressure(deviation) - self.part.pressure
        return self.density * self.speed**2 * np.log1p(deviation / self.density)

    def deviation(self, pressure: np.ndarray) -> np.ndarray:
        """Deviations of density from rest [kg/m3] at pressures above the pressure at rest [Pa]."""
        if self.linear:
            return pressure / self.speed**2
        if self.waves is not None:
            return self.waves.deviation(self.part.pressure + pressure)
        return self.density * np.expm1(pressure / (self.density * self.speed**2))

    def start(self, attitude: np.ndarray | None = None) -> np.ndarray:
        states, given = np.zeros((3, self.n)), self.part.start
        rest = 0.0 if self.part.on is None else self.pressure_at_start()
        if given is not None or self.part.on is not None:
            states[0] = self.deviation(
                rest + (0.0 if given is None else self.formula(given.pressure))
            )
        if given is not None:
            density = self.density + (0.0 if self.linear else states[0])
            states[1], states[2] = density * self.formula(given.u), density * self.formula(given.v)
        return states

    def pressure_at_start(self) -> np.ndarray:
        """Hydrostatic pressure of cells above the pressure at rest at the middle of the basin : float64[n] [Pa].

        It is that on a body without acceleration: dp / rho = -d(phi) with the gravity potential phi.
        """
        from fvsolve.features.basins.lower_motion import potential_at_start

        phi = potential_at_start(self)
        if self.linear:
            return -self.density * phi
        if self.waves is None:
            return -self.density * self.speed**2 * np.log1p(phi / self.speed**2)
        p = np.zeros(self.n)
        for _ in range(STEPS):
            half = p - 0.5 * phi / STEPS * (self.density + self.deviation(p))
            p = p - phi / STEPS * (self.density + self.deviation(half))
        return p

    def fields(self, y: np.ndarray) -> dict[str, np.ndarray]:
        density = self.density + (np.zeros(self.n) if self.linear else y[0])
        velocity = np.column_stack([y[1] / density, y[2] / density, np.zeros(self.n)])
        return {"pressure": self.part.pressure + self.pressure(y[0]), "velocity": velocity}

    def speeds(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = 0.0 if self.linear else 1.0  # the law `linear` has no advection velocity
        return moved * self.fields(y)["velocity"], np.full(self.n, self.speed)

    def ranges(self) -> dict[str, tuple[float, float]]:
        return {"wave_speed": (self.speed, self.speed)}

    def lower_probe(self, row, field: str, cells: np.ndarray, weights: np.ndarray) -> None:
        if field != "pressure":
            return super().lower_probe(row, field, cells, weights)
        row["side"], row["scale"], row["offset"] = PRESSURE, self.speed**2, self.part.pressure

    def at_rest(self) -> float:
        return self.density

    def thrust_at_rest(self) -> np.ndarray:
        return np.full(
            self.n, (self.part.pressure - self.case.ambient_pressure) * self.part.thickness
        )

    def mass(self) -> tuple[float, np.ndarray]:
        per, fluid = self.part.thickness * self.mesh.area, self.case.properties
        density = self.density
        if self.linear:
            density *= 1.0 + (self.part.pressure - fluid.pressure) / (self.density * self.speed**2)
        return float(np.sum(per)) * density, per

    def weights(self, y: np.ndarray) -> np.ndarray:
        per = 0.5 * self.part.thickness * self.mesh.area / self.density
        return np.array([self.speed**2 * per, per, per])

    def energy_of_waves(self, y: np.ndarray) -> float:
        square = (self.speed * y[0]) ** 2 + y[1] ** 2 + y[2] ** 2
        return float(
            0.5
            * self.part.thickness
            / self.case.properties.density
            * np.sum(self.mesh.area * square)
        )

    def above(self, y: np.ndarray, datum: float) -> float:
        rho, height = self.case.properties.density, (self.part.elevation or 0.0) - datum
        rest = self.part.pressure - self.case.ambient_pressure + rho * self.case.gravity * height
        square = (rest + self.speed**2 * y[0]) ** 2 / self.speed**2 + y[1] ** 2 + y[2] ** 2
        return float(0.5 * self.part.thickness / rho * np.sum(self.mesh.area * square))
