"""Solenoids: a coil whose flux pulls an armature."""

from typing import Annotated, ClassVar

from fvsolve.parts.nodes_and_links import Link, Ports
from fvsolve.parts.value import Number, Quantity, UsualRange, positive


class Solenoid(Link, kind="solenoid"):
    """Coil of N turns on a core with one air gap, which its armature closes: N dPhi/dt = voltage of p minus that of n.

    The current R Phi / N enters at `p`, with the reluctance R = core_reluctance (1 + (Phi / saturation_flux)^2) +
    gap / (mu0 pole_area) and the gap |closed_position - x|, x the position of the armature. The force
    Phi^2 / (2 mu0 pole_area) acts on the armature towards closed_position. Ports: p, n (voltage, current), armature
    (velocity, force). Stored energy: core_reluctance (Phi^2 / 2 + Phi^4 / (4 saturation_flux^2)) +
    gap Phi^2 / (2 mu0 pole_area) [J]. Dissipated: none.
    """

    in_network: ClassVar[bool] = True
    joins: ClassVar[dict[str, str]] = {
        "p": "electrical",
        "n": "electrical",
        "armature": "translational",
    }
    quantities: ClassVar[dict[str, str]] = {
        "current": "current",
        "flux": "magnetic_flux",
        "force": "force",
    }
    main_quantities: ClassVar[tuple[str, ...]] = ("current", "force")

    ports: Annotated[
        dict[str, str],
        Ports(("p", "n", "armature"), "terminals p and n, and the mass of the armature"),
    ]
    turns: Annotated[
        float, Number(positive, "turns N of the coil", UsualRange(1.0, 1e6, "busbars to relays"))
    ]
    pole_area: Annotated[
        float,
        Quantity(
            "area",
            positive,
            "area of the air gap [m2]",
            UsualRange(1e-8, 1.0, "watches to lifting magnets"),
        ),
    ]
    closed_position: Annotated[
        float, Quantity("position", about="position of the armature without air gap [m]")
    ]
    core_reluctance: Annotated[
        float, Quantity("reluctance", positive, "reluctance of core and armature [1/H]")
    ]
    saturation_flux: Annotated[
        float | None,
        Quantity(
            "magnetic_flux",
            positive,
            "flux at which the reluctance of the core is twice `core_reluctance`; "
            "no saturation if left out [Wb]",
        ),
    ] = None
    initial_flux: Annotated[
        float | None,
        Quantity(
            "magnetic_flux",
            about="flux at the start; that of the current in equilibrium if left out [Wb]",
        ),
    ] = None
