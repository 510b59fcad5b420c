"""Nominal pipe sizes and fittings by name, from the tables of the package `fluids`.

Loss coefficients of fittings are those of Crane TP-410: K = (L / D) f_T, with the equivalent length L over the diameter
D, and f_T the friction factor of clean commercial steel in fully turbulent flow. The fitting `entrance` has K = 0.5.
"""

import re
from collections.abc import Callable
from typing import Any

from fvsolve.errors import did_you_mean, listing
from fvsolve.units import show

# NPS of each DN below 100; from DN 100 on, DN = 25 NPS (ASME B36.10M).
DN_NPS = {
    6: 0.125, 8: 0.25, 10: 0.375, 15: 0.5, 20: 0.75, 25: 1.0, 32: 1.25, 40: 1.5, 50: 2.0, 65: 2.5, 80: 3.0, 90: 3.5,
}  # fmt: skip

# name -> loss coefficient from fluids.fittings (f), inner diameter d [m] and f_T
FITTINGS: dict[str, Callable[[Any, float, float], float]] = {
    "bend-90": lambda f, d, ft: f.bend_rounded(Di=d, angle=90, fd=ft, bend_diameters=1.5, method="Crane"),
    "bend-45": lambda f, d, ft: f.bend_rounded(Di=d, angle=45, fd=ft, bend_diameters=1.5, method="Crane"),
    "elbow-90": lambda f, d, ft: f.bend_rounded(Di=d, angle=90, fd=ft, method="Crane standard"),
    "elbow-45": lambda f, d, ft: f.bend_rounded(Di=d, angle=45, fd=ft, method="Crane standard"),
    "mitre-90": lambda f, d, ft: f.bend_miter(angle=90, Di=d, method="Crane"),
    "tee-run": lambda f, d, ft: 20.0 * ft,
    "tee-branch": lambda f, d, ft: 60.0 * ft,
    "gate-valve": lambda f, d, ft: f.K_gate_valve_Crane(d, d, 0.0),
    "globe-valve": lambda f, d, ft: f.K_globe_valve_Crane(d, d),
    "angle-valve": lambda f, d, ft: f.K_angle_valve_Crane(d, d),
    "ball-valve": lambda f, d, ft: f.K_ball_valve_Crane(d, d, 0.0),
    "plug-valve": lambda f, d, ft: f.K_plug_valve_Crane(d, d, 0.0),
    "butterfly-valve": lambda f, d, ft: f.K_butterfly_valve_Crane(d),
    "swing-check-valve": lambda f, d, ft: f.K_swing_check_valve_Crane(d, angled=True),
    "foot-valve": lambda f, d, ft: f.K_foot_valve_Crane(d),
    "entrance": lambda f, d, ft: f.entrance_sharp(method="Crane"),
}


WHOLE, MIXED = r"\d+(?:\.\d+)?", r"(?:\d+(?:\s+|\s*-\s*))?[1-9]\d*\s*/\s*[1-9]\d*"  # 1.5; 1/2, 1-1/2, 1 1/2


def parse_inches(text: str) -> float:
    """Number of a text such as "1.5", "1/2", "1-1/2" or "1 1/2"."""
    *whole, last = re.split(r"\s*-\s*|(?<!/)(?<!/ )\s+(?!/)", text)
    top, _, bottom = last.partition("/")
    return sum(map(float, whole)) + float(top) / float(bottom or 1)


def pipe_bore(nominal: str, schedule: str) -> tuple[float, float]:
    """(inner diameter [m], wall thickness [m]) of a nominal size such as "DN100" or "NPS 4" in a schedule.

    Raises ValueError for an unknown size or schedule.
    """
    from fluids.piping import nearest_pipe, schedule_lookup

    match = re.fullmatch(rf"(DN|NPS)\s*({WHOLE}|{MIXED})", nominal.strip(), re.IGNORECASE)
    if match is None:
        raise ValueError(f'{show(nominal)} is not a nominal size; expected for example "DN100", "NPS 4" or "NPS 1-1/2"')
    if schedule not in schedule_lookup:
        near = did_you_mean(schedule, schedule_lookup) or f"; schedules are {listing(schedule_lookup)}"
        raise ValueError(f"no schedule named {show(schedule)}{near}")
    number = parse_inches(match[2])
    if match[1].upper() == "DN":
        number = DN_NPS.get(number, number / 25.0)
    sizes = schedule_lookup[schedule][0]
    if number not in sizes:
        near = ", ".join(f"NPS {size:g}" for size in sorted(sizes, key=lambda size: abs(size - number))[:3])
        raise ValueError(f"{nominal} is not made in schedule {schedule}; the nearest sizes are {near}")
    _, inner, _, wall = nearest_pipe(NPS=number, schedule=schedule)
    return inner, wall


def fittings_loss(names: list[str], diameter: float) -> float:
    """Sum of the loss coefficients of fittings in a pipe with a given inner diameter [m]."""
    from fluids import fittings
    from fluids.friction import ft_Crane

    return sum(FITTINGS[name](fittings, diameter, ft_Crane(diameter)) for name in names)
