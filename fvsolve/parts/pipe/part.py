"""Pipes: keys, faults, and names of catalogue entries turned into numbers."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from fvsolve.parts.carried_scalar import ScalarValues
from fvsolve.parts.full_pipe import LENGTH, FullPipe
from fvsolve.parts.pipe.elevation_profile import Profile, ProfileValue
from fvsolve.parts.pipe.pipe_wall import (
    MODULI,
    Lining,
    MaterialName,
    Restraint,
    RetardationFactor,
    Wall,
    WallOrRigid,
    creep_elements,
    retardation_faults,
    wall_faults,
)
from fvsolve.parts.table_model import CaseContext, Faults, Nested
from fvsolve.parts.value import (
    BY_CELLS,
    SHAPE,
    VALUE,
    Choice,
    Number,
    Quantity,
    ReadContext,
    Rows,
    Text,
    UsualRange,
    ValueFault,
    Whole,
    between,
    faults_of,
    positive,
)

MOST_CELLS = 10**8
# keys from which others are derived, besides nominal sizes
CATALOGUE = frozenset(("material", "class", "lining"))
LENGTH_TOLERANCE = 1e-6  # allowed difference of the span of chainage, over length
ELEVATION_TOLERANCE = 1e-6  # allowed difference in elevation of profile and nodes [m]
END_VERBS = {"from": "begins", "to": "ends"}
QUASI_STEADY = "quasi-steady"
LINES = ("finite-volume", "delay-line", "auto", QUASI_STEADY)  # models of the flow in a pipe


# Most are between 50 and 1500 m/s, Wylie and Streeter 1993
WAVES = UsualRange(30.0, 2000.0, "soft hoses to stiff pipes")
# (modulus [Pa], least wall over bore of such a pipe, text); the thinnest plastics are SDR 26
SOFT_WALLS = (
    (2e8, 0.1, "softer than any plastic, like rubber"),
    (4e8, 0.04, "as soft as low-density polyethylene"),
)


class Pipe(FullPipe, kind="pipe"):
    """A pipe, straight or along a profile: balances of mass and momentum along the axis, wave speed sqrt(K / rho).

    K is the effective bulk modulus of fluid and wall. Ports: from, to; each end has one outgoing characteristic. Stored
    energy: rho A integral of (v^2 / 2 + p^2 / (2 rho K) + g z) dx [J] over the length, with area A, velocity v,
    pressure p above ambient and elevation z. Dissipated power: friction and minor loss, pressure drop times flow [W].
    """

    # pipe model -> class of pipes with keys and rows of their own
    models: ClassVar[dict[str, type["Pipe"]]] = {}
    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "force": "force"}
    on_request: ClassVar[tuple[str, ...]] = ("force",)
    own_scalars: ClassVar[str] = "along"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        *FullPipe.alternatives,
        ("wave_speed", "wall"),
        ("diameter", "class"),
        ("schedule", "class"),
        ("wave_speed", "restraint"),
    )
    along: ClassVar[dict[str, str]] = {
        "pressure": "pressure",
        "gauge_pressure": "gauge_pressure",
        "head": "head",
        "velocity": "velocity",
        "flow": "flow",
    }

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (*FullPipe.needs, ("length", "profile"))

    length: Annotated[float, LENGTH] = None  # the length of profile is its default
    profile: Annotated[Profile | None, ProfileValue()] = None
    bends: Annotated[
        tuple[float, ...] | None,
        Rows(
            "length",
            rising=True,
            about="chainages of bends, which divide the pipe into legs [m]",
            changes=SHAPE,
        ),
    ] = None
    wave_speed: Annotated[
        float | None,
        Quantity("velocity", positive, "wave speed, instead of `wall` [m/s]", WAVES, BY_CELLS),
    ] = None
    wall: Annotated[Wall | Literal["rigid"] | None, WallOrRigid()] = None
    material: Annotated[str | None, MaterialName()] = None
    class_: Annotated[
        str | None,
        Text(
            'pressure class or schedule: "K9", "C40", "SDR11", "PN16", "schedule 40"; with `nominal` it sets bore, '
            "wall and allowable pressure",
            BY_CELLS,
        ),
        Field(alias="class"),
    ] = None
    restraint: Annotated[str | float | None, Restraint()] = None
    lining: Annotated[
        Lining | None, Nested(Lining, "inner layer of the wall; `diameter` is the bore inside it")
    ] = None
    allowable_pressure: Annotated[
        float | None,
        Quantity(
            "gauge_pressure",
            positive,
            "allowable pressure above ambient [Pa]; that of the key `class` if left out",
            changes=VALUE,
        ),
    ] = None
    source: Annotated[
        str | None,
        Text("source of the data of the pipe; the sources of the catalogue if left out", VALUE),
    ] = None
    cells: Annotated[
        int | None,
        Whole(
            between(1, MOST_CELLS),
            "number of finite volumes; travel time over numerics.cell_time if left out",
        ),
    ] = None
    pipe_model: Annotated[
        str | None,
        Choice(
            "pipe model",
            LINES,
            "method for waves: finite volumes, a delay line, whose cells are only output positions, auto (a delay line "
            "where its error bound is below numerics.delay_tolerance), or quasi-steady (no waves, no inertia: the flow "
            "follows its losses at once); numerics.pipe_model if left out",
        ),
    ] = None
    scalars: Annotated[
        dict[str, Any], ScalarValues("scalar values in the pipe at the start", Number())
    ] = {}
    retardation: Annotated[
        dict[str, Any],
        ScalarValues(
            "retardation factor of each scalar: what fluid and wall store, over "
            'what the fluid stores; `"wall"` computes '
            "that of a temperature from the wall; 1 if left out",
            RetardationFactor(),
        ),
    ] = {}

    def __init_subclass__(cls, pipe_model: str = "", **rest: Any) -> None:
        super().__init_subclass__(**rest)
        if pipe_model:
            Pipe.models[pipe_model] = cls

    @classmethod
    def variant(cls, given: dict[str, Any]) -> "type[Pipe]":
        return Pipe.models.get(str(given.get("pipe_model")), Pipe)

    @property
    def creep_elements(self) -> tuple[tuple[float, float], ...]:
        """(final relative growth of the bore area per pressure [1/Pa], time constant [s]) of each creep element."""
        return creep_elements(self)

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        # a fault of the class reports a missing nominal
        sized = "class" in given and "diameter" not in given
        return super().key_faults({"nominal": "", **given} if sized else given)

    @classmethod
    def resolve_keys(cls, given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
        """Table in which numbers replace names of catalogue entries and nominal sizes.

        Raises ValueFault for unknown names.
        """
        faults, values = [], given
        if not CATALOGUE.isdisjoint(given):
            from fvsolve.parts.pipe.catalogue import from_catalogue, with_substitutes

            try:
                values = from_catalogue(given)
            except ValueFault as error:
                faults, values = error.faults, with_substitutes(given)
                values = {
                    key: value
                    for key, value in values.items()
                    if key not in ("nominal", "schedule", "class")
                }
        for read in (super().resolve_keys, add_profile_length):
            try:
                values = read(values, setting)
            except ValueFault as error:
                faults = faults + error.faults
        if faults:
            raise ValueFault(faults, values)
        return values

    def faults(self, name: str, around: CaseContext) -> Faults:
        yield from wall_faults(self)
        yield from retardation_faults(self)
        yield from self.profile_faults(around)

    def profile_faults(self, around: CaseContext) -> Faults:
        """Faults of the elevation profile of a pipe.

        Its length must agree with that of the pipe, its end elevations with those of the nodes, and no end may be on a
        body.
        """
        if self.profile is None:
            return
        if abs(self.profile.length - self.length) > LENGTH_TOLERANCE * self.length:
            text = f"the axis is {self.profile.length:.10g} m long, and `length` is {self.length:.10g} m"
            yield ("profile",), f"{text}; expected equal lengths; leave `length` out"
        for place, end, z in zip(
            ("from", "to"), (self.from_, self.to), self.profile.elevation[[0, -1]], strict=True
        ):
            node = around.nodes.get(end)
            if getattr(node, "on", None) is not None:
                yield (
                    ("profile",),
                    f"{end} is on body {node.on}, and pipes on bodies are straight; leave `profile` out",
                )
            stated = getattr(node, "elevation", None)
            if stated is not None and abs(stated - z) > ELEVATION_TOLERANCE:
                text = (
                    f"the elevation of {end} is {stated:.10g} m, and the profile {END_VERBS[place]} at {z:.10g} m; "
                    "expected equal elevations"
                )
                yield (
                    ("profile",),
                    f"{text}, or no elevation of {end}, which then takes that of the profile",
                )

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from super().unusual()
        wall = self.wall
        if not isinstance(wall, Wall) or wall.youngs_modulus < MODULI.least:
            return
        for limit, thin, example in SOFT_WALLS:
            if wall.youngs_modulus < limit and wall.thickness < thin * self.diameter:
                text = (
                    f"{wall.youngs_modulus:g} Pa is {example} (below {limit:g} Pa); for such a material a wall of "
                    f"{wall.thickness:g} m is too thin in a bore of {self.diameter:g} m; "
                    "is the unit GPa?"
                )
                yield ("wall", "youngs_modulus"), wall.youngs_modulus, limit, text
                return


def add_profile_length(given: dict[str, Any], setting: ReadContext) -> dict[str, Any]:
    """Table with the length of the profile added, if no length is given; raises ValueFault for a faulty profile."""
    if "profile" not in given:
        return given
    try:
        profile = ProfileValue().read(given["profile"], setting)
    except ValueError as error:
        raise ValueFault(faults_of(error, "profile")) from None
    return {"length": profile.length, **given, "profile": profile}
