"""Coefficients of friction, laminar transitions and hydrostatics of a case."""

import math

from fvsolve.kernels import dtypes as rec

HAZEN_WILLIAMS = 4.727 * 0.3048**-0.685  # h / L = 10.667 q^1.852 / (C^1.852 D^4.871), EPANET's 4.727 in feet, as SI
MANNING = 4.0 ** (10.0 / 3.0) / math.pi**2  # h / L = 10.294 n^2 q^2 / D^(16/3), SI


class Hydraulics:
    """Coefficients of friction, transition and hydrostatics, from sizes of parts, the fluid and gravity."""

    def __init__(self, case) -> None:
        self.case, self.fluid = case, case.properties
        self.rho, self.gravity, self.ambient = self.fluid.density, case.gravity, case.ambient_pressure

    def add_head(self, schedules, head, row) -> int:
        """Add a schedule of head [m] as pressure [Pa] at the elevation of a node's row; return its index.

        Under density laws other than `linear` the schedule remains a head, and `head_given` of the row is set.
        """
        if not self.case.law.linear:
            row["head_given"] = 1
            return schedules.add(head)
        elevation = row["elevation"]
        weight = self.rho * self.gravity
        return schedules.add(head, weight, self.ambient - weight * elevation)

    def friction(self, name: str, link, row, fault) -> None:
        """Set the friction coefficients of a pipe or rigid column in its row, for mass flow M [kg/s].

        They give dM/dt = -loss |M| M - rough f(Re) |M| M with the Darcy factor f, or for Hazen-Williams -loss |M| M -
        rough |M|^0.852 M, see `kernels.steady_friction`. For `steady` friction by roughness the factor is set later,
        from the starting flow. Adds a fault if the law needs a viscosity and the fluid has none.
        """
        area = math.pi / 4.0 * link.diameter**2
        law, row["loss"] = link.friction, link.minor_loss / (2.0 * self.rho * area**2 * link.length) * area
        per_factor = 1.0 / (2.0 * link.diameter * self.rho * area)
        row["friction"] = rec.FRICTION_NONE if row["loss"] == 0.0 else rec.FRICTION_FACTOR
        if law.model == "none":
            return
        if law.model == "unsteady" and not self.fluid.viscosity:
            fault(f"links.{name}.friction", '"unsteady" needs the fluid\'s viscosity; give the key `fluid.viscosity`')
            return
        if law.model == "hazen-williams":
            row["friction"] = rec.FRICTION_HAZEN
            row["rough"] = (
                area * self.rho * self.gravity * HAZEN_WILLIAMS
                / (self.rho**1.852 * law.coefficient**1.852 * link.diameter**4.871)
            )  # fmt: skip
        elif law.model == "chezy-manning":
            row["friction"] = rec.FRICTION_FACTOR
            row["loss"] += (
                area * self.gravity * MANNING * law.coefficient**2 / (self.rho * link.diameter ** (16.0 / 3.0))
            )
        elif law.factor is not None:
            row["friction"] = rec.FRICTION_FACTOR
            row["loss"] += per_factor * law.factor
        elif not self.fluid.viscosity:
            fault(
                f"links.{name}.friction",
                "the key `roughness` needs the fluid's viscosity; give `fluid.viscosity`, or the key `factor`",
            )
        else:
            row["friction"], row["rough"] = rec.FRICTION_ROUGH, per_factor
            row["roughness"] = law.roughness / link.diameter
            row["reynolds"] = link.diameter / (area * self.fluid.viscosity)

    def compliance(self, name: str, speed: float, fault) -> float:
        """Relative growth of a pipe's area with pressure [1/Pa], from the density law and the wave speed [m/s].

        Growth below rounding is 0. Adds a fault if it is negative, as the wave speed then exceeds the speed of sound in
        the fluid.
        """
        growth = self.case.law.compliance(speed)
        if growth < -1e-9 / self.fluid.bulk_modulus:
            given, sound = (
                self.case.amount(speed_value, "velocity", 6) for speed_value in (speed, self.fluid.sound_speed)
            )
            fault(f"links.{name}.wave_speed", f"{given} is faster than sound in the fluid, {sound}; expected at most "
                  'the speed of sound, or law = "linear"')  # fmt: skip
        return growth if growth > 1e-9 / self.fluid.bulk_modulus else 0.0

    def transition_flow(self, name: str, link, reynolds: float, fault) -> float:
        """Mass flow [kg/s] of a fully open restriction at the Reynolds number `reynolds` = 4 M / (pi d mu).

        M : mass flow [kg/s]; d : diameter of the opening [m]; mu : viscosity [Pa s]
        If the fluid has no viscosity, the kinematic viscosity of water is used; a stated key `laminar_reynolds` is then
        a fault.
        """
        area = link.flow_area()
        if link.diameter is not None:
            area = math.pi / 4.0 * link.diameter**2
        elif link.area is not None:
            area = link.area
        diameter = math.sqrt(4.0 * area / math.pi)
        viscosity = self.fluid.viscosity
        if not viscosity:
            if link.laminar_reynolds is not None:
                fault(f"links.{name}.laminar_reynolds", "needs the fluid's viscosity; give the key `fluid.viscosity`")
            viscosity = 1e-6 * self.rho  # water's: it only bounds the slope at zero drop
        return reynolds * math.pi / 4.0 * diameter * viscosity
