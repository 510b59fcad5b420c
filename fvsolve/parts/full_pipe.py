"""Friction, nominal sizes and fittings of pipes and rigid columns, and the keys that both have.

Sizes and fittings are from the tables of the package `fluids`. Loss coefficients of fittings are those of Crane TP-410:
K = (L / D) f_T, with the equivalent length L over the diameter D, and f_T the friction factor of clean commercial
steel in fully turbulent flow. The fitting `entrance` has K = 0.5.
"""

import re
from collections.abc import Callable, Iterator
from typing import Annotated, Any, ClassVar

from fvsolve import units
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.table_model import Table, missing_key_faults
from fvsolve.parts.value import (
    BY_CELLS,
    PROFILE,
    SHAPE,
    Choice,
    Number,
    Quantity,
    ReadContext,
    Text,
    UsualRange,
    Value,
    ValueFault,
    between,
    nonnegative,
    positive,
)
from fvsolve.units import show

# NPS of each DN below 100; from DN 100 on, DN = 25 NPS (ASME B36.10M).
DN_NPS = {
    6: 0.125,
    8: 0.25,
    10: 0.375,
    15: 0.5,
    20: 0.75,
    25: 1.0,
    32: 1.25,
    40: 1.5,
    50: 2.0,
    65: 2.5,
    80: 3.0,
    90: 3.5,
}

# name -> loss coefficient from fluids.fittings (f), inner diameter d [m] and f_T
FITTINGS: dict[str, Callable[[Any, float, float], float]] = {
    "bend-90": lambda f, d, ft: f.bend_rounded(
        Di=d, angle=90, fd=ft, bend_diameters=1.5, method="Crane"
    ),
    "bend-45": lambda f, d, ft: f.bend_rounded(
        Di=d, angle=45, fd=ft, bend_diameters=1.5, method="Crane"
    ),
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


# 1.5; 1/2, 1-1/2, 1 1/2, of a text without two blanks in a row
WHOLE, MIXED = r"\d+(?:\.\d+)?", r"(?:\d+(?: | ?- ?))?[1-9]\d* ?/ ?[1-9]\d*"


def parse_inches(text: str) -> float:
    """Number of a text such as "1.5", "1/2", "1-1/2" or "1 1/2"."""
    *whole, last = re.split(r" ?- ?|(?<!/)(?<!/ ) (?!/)", " ".join(text.split()))
    top, _, bottom = last.partition("/")
    return sum(map(float, whole)) + float(top) / float(bottom or 1)


def pipe_bore(nominal: str, schedule: str) -> tuple[float, float]:
    """(inner diameter [m], wall thickness [m]) of a nominal size such as "DN100" or "NPS 4" in a schedule.

    Raises ValueError for an unknown size or schedule.
    """
    from fluids.piping import nearest_pipe, schedule_lookup

    match = re.fullmatch(rf"(DN|NPS) ?({WHOLE}|{MIXED})", " ".join(nominal.split()), re.IGNORECASE)
    if match is None:
        raise ValueError(
            f'{show(nominal)} is not a nominal size; expected for example "DN100", "NPS 4" or "NPS 1-1/2"'
        )
    if schedule not in schedule_lookup:
        near = (
            did_you_mean(schedule, schedule_lookup) or f"; schedules are {listing(schedule_lookup)}"
        )
        raise ValueError(f"no schedule named {show(schedule)}{near}")
    number = parse_inches(match[2])
    if match[1].upper() == "DN":
        number = DN_NPS.get(number, number / 25.0)
    sizes = schedule_lookup[schedule][0]
    if number not in sizes:
        near = ", ".join(
            f"NPS {size:g}" for size in sorted(sizes, key=lambda size: abs(size - number))[:3]
        )
        raise ValueError(
            f"{nominal} is not made in schedule {schedule}; the nearest sizes are {near}"
        )
    _, inner, _, wall = nearest_pipe(NPS=number, schedule=schedule)
    return inner, wall


def fittings_loss(names: list[str], diameter: float) -> float:
    """Sum of the loss coefficients of fittings in a pipe with a given inner diameter [m]."""
    from fluids import fittings
    from fluids.friction import ft_Crane

    return sum(FITTINGS[name](fittings, diameter, ft_Crane(diameter)) for name in names)


MODELS = (
    "none",
    "steady",
    "quasi-steady",
    "unsteady",
    "swamee-jain",
    "hazen-williams",
    "chezy-manning",
)
WEIGHTINGS = ("zielke", "vardy-brown")
DARCY = ("roughness", "factor")
DARCY_WEISBACH = '"quasi-steady" or "steady" with a roughness, whose factor is Colebrook\'s'
SYNONYMS = dict.fromkeys(
    ("colebrook", "colebrook-white", "moody", "haaland", "darcy", "darcy-weisbach", "d-w", "dw"),
    DARCY_WEISBACH,
) | {
    "h-w": '"hazen-williams"',
    "hw": '"hazen-williams"',
    "manning": '"chezy-manning"',
    "c-m": '"chezy-manning"',
}
# keys of each model; at least one of the Darcy pair, or the coefficient, is needed
KEYS_OF_MODEL = {
    "none": (),
    "steady": DARCY,
    "quasi-steady": DARCY,
    "unsteady": (*DARCY, "weighting", "accuracy"),
    "swamee-jain": ("roughness",),
    "hazen-williams": ("coefficient",),
    "chezy-manning": ("coefficient",),
}


# the chart spans 0.008 to 0.1
FACTORS = UsualRange(0.004, 0.5, "Moody's chart and slow laminar flow")
COEFFICIENTS = {  # usual coefficients by model, from textbooks and the EPANET manual
    # plastic has 155; more if an import lengthened a pipe
    "hazen-williams": UsualRange(40.0, 500.0, "C of tuberculated iron to plastic"),
    "chezy-manning": UsualRange(0.006, 0.06, "n of glass to unlined rock"),
}


class Friction(Table):
    """Friction model of a pipe.

    steady : Darcy factor of the initial flow; quasi-steady : Darcy factor of the present flow
    unsteady : quasi-steady, plus the effect of past flow changes by a weighting function, a sum of exponentials; each
    term of the sum is a state of every cell and stores energy
    swamee-jain : Darcy factor of the present flow by the formula of Swamee and Jain, as in EPANET; the others take that
    of Colebrook, from which it differs by about 3 % at most
    hazen-williams, chezy-manning : empirical formulas with a `coefficient`. Dissipated power: pressure drop times flow
    [W].
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("roughness", "factor"),)

    model: Annotated[str, Choice("friction model", MODELS, "model of the wall friction", SYNONYMS)]
    roughness: Annotated[
        float | None,
        Quantity(
            "length",
            nonnegative,
            "roughness of the wall for the models steady, quasi-steady, unsteady, swamee-jain [m]",
        ),
    ] = None
    factor: Annotated[
        float | None,
        Number(
            nonnegative,
            "Darcy friction factor, four times Fanning's, instead of `roughness` [-]",
            FACTORS,
        ),
    ] = None
    coefficient: Annotated[
        float | None,
        Number(positive, "coefficient C of hazen-williams [-], or n of chezy-manning [s/m^(1/3)]"),
    ] = None

    weighting: Annotated[
        str | None,
        Choice(
            "weighting function",
            WEIGHTINGS,
            "weighting function of past flow changes, model unsteady; "
            "chosen by the initial Reynolds number if left out",
        ),
    ] = None
    accuracy: Annotated[
        float | None,
        Number(
            between(1e-6, 0.1),
            "relative accuracy of the sum of exponentials, model unsteady; 1e-4 if left out",
            changes=SHAPE,
        ),
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        model = given.get("model")
        allowed = KEYS_OF_MODEL.get(model if isinstance(model, str) else "")
        faults = super().key_faults(given)
        if allowed is None:
            return faults
        stray = [key for key in given if key in cls.model_fields and key not in ("model", *allowed)]
        faults += [
            ((key,), f'friction model "{model}" has no key {key}; remove this key') for key in stray
        ]
        return faults + (missing_key_faults(given, allowed[:2]) if allowed else [])

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        usual, c = COEFFICIENTS.get(self.model), self.coefficient
        if usual is None or usual.least <= c <= usual.greatest:
            return
        text = f"{c:g} is outside {usual.least:g} to {usual.greatest:g}, {usual.source}"
        other = next(
            (m for m, span in COEFFICIENTS.items() if span.least <= c <= span.greatest), None
        )
        text += f'; did you mean model = "{other}"?' if other else ""
        yield ("coefficient",), c, usual.least if c < usual.least else usual.greatest, text


NONE = Friction(model="none")


# the tunnels of Tarbela have 13.7 m
BORES = UsualRange(5e-5, 14.0, "capillaries to pressure tunnels")
LENGTH = Quantity(
    "length",
    positive,
    "length along its axis [m]",
    UsualRange(1e-4, 1e7, "fittings to pipelines"),
    BY_CELLS,
)
DIAMETER = Quantity("length", positive, "inner diameter [m]", BORES, BY_CELLS)
LOSS = Number(
    nonnegative,
    "loss coefficient K referred to the velocity in the pipe, distributed along its length",
)


MAX_ROUGHNESS = 0.05  # relative roughness, Moody 1944


class Fittings(Value):
    """Value of a case file for a list of names of fittings; names may repeat."""

    about = "names of fittings; their loss coefficients are added to minor_loss"
    takes = "list of names"
    changes = PROFILE

    def read(self, given: Any, setting: ReadContext) -> list[str]:
        if not isinstance(given, (list, tuple)):
            raise ValueFault(
                [
                    (
                        (),
                        f'{show(given)} is not a list; expected for example ["bend-90", "gate-valve"]',
                    )
                ]
            )
        faults = []
        for index, name in enumerate(given):
            if not isinstance(name, str) or name not in FITTINGS:
                near = (
                    did_you_mean(str(name), FITTINGS) or f"; fittings are {listing(list(FITTINGS))}"
                )
                faults.append(((index,), f"no fitting named {show(name)}{near}"))
        if faults:
            raise ValueFault(faults)
        return list(given)

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": {"enum": list(FITTINGS)}}


class FullPipe(TwoPort):
    """Base of pipe and rigid column, which are full of fluid.

    `nominal` and `fittings` are read as `diameter`, `thickness` and `minor_loss`.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("diameter", "nominal"),
        ("diameter", "schedule"),
    )

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("diameter", "nominal"),)

    synonyms: ClassVar[dict[str, str]] = dict.fromkeys(
        ("roughness", "factor", "friction_factor", "darcy_factor"),
        'friction = { model = "quasi-steady", roughness = "0.1 mm" } or { model = "steady", factor = 0.02 }',
    ) | dict.fromkeys(
        ("celerity", "sound_speed", "youngs_modulus", "thickness", "wall_thickness", "material"),
        'wave_speed, or wall = { youngs_modulus = "210 GPa", thickness = "8 mm" }',
    )

    length: Annotated[float, LENGTH]
    diameter: Annotated[float, DIAMETER] = None  # nominal replaces it
    nominal: Annotated[
        str | None,
        Text('nominal size, instead of `diameter`: "DN100", "NPS 4" or "NPS 1-1/2"', BY_CELLS),
    ] = None
    schedule: Annotated[
        str | None,
        Text('schedule of the nominal size: "40", "80", "STD", "10S"; "40" if left out', BY_CELLS),
    ] = None
    friction: Friction = NONE
    minor_loss: Annotated[float, LOSS] = 0.0
    fittings: Annotated[list[str] | None, Fittings()] = None
    initial_flow: Annotated[
        float | None,
        Quantity("flow", about="flow at the start [m3/s]; flow of the steady state if left out"),
    ] = None

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        if self.diameter > self.length:
            text = (
                f"{self.diameter:g} m is more than the length of {self.length:g} m, so the flow is not "
                "one-dimensional; check the units of `diameter` and `length`"
            )
            yield ("diameter",), self.diameter, self.length, text
        rough, most = self.friction.roughness or 0.0, MAX_ROUGHNESS * self.diameter
        if rough > most:
            text = (
                f"{rough:g} m is {rough / self.diameter:.3g} of the bore of {self.diameter:g} m; Moody's chart is "
                f"valid up to {MAX_ROUGHNESS:g} of the bore"
            )
            likely = units.likely(rough, "length", 0.0, most) if rough <= 1e3 * most else ""
            yield ("friction", "roughness"), rough, most, text + likely

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        """Table in which `diameter`, wall `thickness` and `minor_loss` replace catalogue names.

        Raises ValueFault for unknown names.
        """
        result, faults = {**given}, []
        if isinstance(given.get("nominal"), str) and "diameter" not in given:
            try:
                result["diameter"], thickness = pipe_size(
                    result.pop("nominal"), result.pop("schedule", "40")
                )
                if isinstance(given.get("wall"), dict):
                    result["wall"] = {"thickness": thickness, **given["wall"]}
            except ValueFault as error:
                faults += error.faults
        if "fittings" in result:
            try:
                names = Fittings().read(result.pop("fittings"), setting)
                own = LOSS.read(result.get("minor_loss", 0.0), setting)
                result["minor_loss"] = own + fittings_loss(
                    names, DIAMETER.read(result["diameter"], setting)
                )
            except ValueFault as error:
                faults += [(("fittings", *keys), text) for keys, text in error.faults]
            except (KeyError, ValueError):  # a key that is missing or faulty: reported by itself
                pass
        if faults:
            raise ValueFault(faults)
        return result


def pipe_size(nominal: str, schedule: Any) -> tuple[float, float]:
    """(inner diameter [m], wall thickness [m]) of a nominal size and schedule; raises ValueFault with the wrong key."""
    try:
        return pipe_bore(nominal, str(schedule))
    except ValueError as error:
        key = "schedule" if "schedule named" in str(error) else "nominal"
        raise ValueFault([((key,), str(error))]) from None
