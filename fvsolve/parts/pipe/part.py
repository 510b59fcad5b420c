"""A conduit in which waves travel. Knows its size, wall and friction; computes nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from fvsolve.parts.around import Around, Faults
from fvsolve.parts.conduit import LENGTH, Conduit
from fvsolve.parts.pipe.profile import Profile, ProfileValue
from fvsolve.parts.pipe.wall import MODULI, Lining, OfCatalogue, Restraint, Wall, WallOrStiff, wall_faults, yielding
from fvsolve.parts.scalar import Carried
from fvsolve.parts.table import Inside
from fvsolve.parts.value import (
    COUNTED,
    SHAPE,
    VALUE,
    Choice,
    Misfit,
    Number,
    Quantity,
    Rows,
    Setting,
    Text,
    Usual,
    Whole,
    between,
    positive,
)

MOST_CELLS = 10**8
CATALOGUE = frozenset(("material", "class", "lining"))  # keys that stand for others, beside names of sizes
SPANNED = 1e-6  # of its length, by which chainage may differ from it
MET = 1e-6  # in elevation, by which a profile may miss its nodes [m]
ENDS = {"from": "begins", "to": "ends"}
LINES = ("cells", "delay", "auto")  # how waves in a pipe are followed


WAVES = Usual(30.0, 2000.0, "soft hoses to stiff pipes")  # most are between 50 and 1500 m/s, Wylie and Streeter 1993
SOFT = (  # modulus [Pa], wall over bore below which no pipe of it stands: of the plastics SDR 26 is the thinnest
    (2e8, 0.1, "softer than any plastic, as rubber is"),
    (4e8, 0.04, "soft as low-density polyethylene"),
)


class Pipe(Conduit, kind="pipe"):
    """A pipe, straight or along a profile: mass and momentum along it, wave speed sqrt(K / rho).

    Ports: from, to; each end offers its outgoing characteristic. Stored energy, p from ambient: rho A
    integral of (v^2 / 2 + p^2 / (2 rho K) + g z) dx [J]. Dissipated power: friction and minor loss, pressure
    drop times flow [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "force": "force"}
    asked: ClassVar[tuple[str, ...]] = ("force",)
    own_scalars: ClassVar[str] = "along"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        *Conduit.alternatives, ("wave_speed", "wall"), ("diameter", "class"), ("schedule", "class"),
        ("wave_speed", "restraint"),
    )  # fmt: skip
    along: ClassVar[dict[str, str]] = {
        "pressure": "pressure", "gauge_pressure": "gauge_pressure", "head": "head", "velocity": "velocity",
        "flow": "flow",
    }  # fmt: skip

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (*Conduit.needs, ("length", "profile"))

    length: Annotated[float, LENGTH] = None  # that of profile stands in for it
    profile: Annotated[Profile | None, ProfileValue()] = None
    bends: Annotated[
        tuple[float, ...] | None,
        Rows("length", rising=True, about="chainages at which it is cut into legs", changes=SHAPE),
    ] = None
    wave_speed: Annotated[float | None, Quantity("velocity", positive, "in place of wall [m/s]", WAVES, COUNTED)] = None
    wall: Annotated[Wall | Literal["stiff"] | None, WallOrStiff()] = None
    material: Annotated[str | None, OfCatalogue()] = None
    class_: Annotated[
        str | None,
        Text('"K9", "C40", "SDR11", "PN16" or "schedule 40" of the nominal size: bore, wall, what it bears', COUNTED),
        Field(alias="class"),
    ] = None
    restraint: Annotated[str | float | None, Restraint()] = None
    lining: Annotated[Lining | None, Inside(Lining, "a second layer within the wall; diameter is within it")] = None
    allowable_pressure: Annotated[
        float | None, Quantity("gauge_pressure", positive, "that its class bears, above ambient [Pa]", changes=VALUE)
    ] = None
    source: Annotated[str | None, Text("whose figures these are; those of the catalogue if left out", VALUE)] = None
    cells: Annotated[
        int | None,
        Whole(between(1, MOST_CELLS), "finite volumes along it; as many as its travel time over cell_time if left out"),
    ] = None
    line: Annotated[
        str | None,
        Choice(
            "line",
            LINES,
            "waves by cells, or as a delay line, whose cells are but places where fields and envelopes are told; auto: "
            "a delay line where its bound is below numerics.accuracy; numerics.line if left out",
        ),
    ] = None
    scalars: Annotated[dict[str, Any], Carried("of scalars in it at the start", Number())] = {}

    @property
    def yielding(self) -> tuple[tuple[float, float], ...]:
        """(growth of the bore with pressure in the end [1/Pa], time [s]) of each element by which its wall creeps."""
        return yielding(self)

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        sized = "class" in given and "diameter" not in given  # it asks for nominal itself
        return super().key_faults({"nominal": "", **given} if sized else given)

    @classmethod
    def in_numbers(cls, given: dict[str, Any], setting: Setting) -> dict[str, Any]:
        """Names of the catalogue and of sizes turned into numbers; Misfit where one means nothing."""
        faults, found = [], given
        if not CATALOGUE.isdisjoint(given):
            from fvsolve.parts.pipe.catalogue import from_catalogue, stood_in

            try:
                found = from_catalogue(given)
            except Misfit as error:
                faults, found = error.faults, stood_in(given)
                found = {key: one for key, one in found.items() if key not in ("nominal", "schedule", "class")}
        for read in (super().in_numbers, along_profile):
            try:
                found = read(found, setting)
            except Misfit as error:
                faults = faults + error.faults
        if faults:
            raise Misfit(faults, found)
        return found

    def faults(self, name: str, around: Around) -> Faults:
        yield from wall_faults(self)
        yield from self.profile_faults(around)

    def profile_faults(self, around: Around) -> Faults:
        """What is wrong of its profile beside its nodes."""
        if self.profile is None:
            return
        if abs(self.profile.length - self.length) > SPANNED * self.length:
            text = f"chainage spans {self.profile.length:.10g} m, and length is {self.length:.10g} m"
            yield ("profile",), f"{text}; leave it out"
        for place, end, z in zip(("from", "to"), (self.from_, self.to), self.profile.elevation[[0, -1]], strict=True):
            node = around.nodes.get(end)
            if getattr(node, "on", None) is not None:
                yield ("profile",), f"{end} rides on {node.on}, and a pipe on a body is straight"
            stated = getattr(node, "elevation", None)
            if stated is not None and abs(stated - z) > MET:
                text = f"{end} lies at {stated:.10g} m, and it {ENDS[place]} at {z:.10g} m; wanted the same"
                yield ("profile",), f"{text}, or no elevation of {end}, which then has that of the profile"

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        yield from super().unusual()
        wall = self.wall
        if not isinstance(wall, Wall) or wall.youngs_modulus < MODULI.least:
            return
        for limit, thin, what in SOFT:
            if wall.youngs_modulus < limit and wall.thickness < thin * self.diameter:
                text = (f"{wall.youngs_modulus:g} Pa is below {limit:g} Pa, {what}, for which a wall of "
                        f"{wall.thickness:g} m is too thin in a bore of {self.diameter:g} m; GPa meant?")  # fmt: skip
                yield ("wall", "youngs_modulus"), wall.youngs_modulus, limit, text
                return


def along_profile(given: dict[str, Any], setting: Setting) -> dict[str, Any]:
    """The length of a profile where none is stated; Misfit where it is none."""
    if "profile" not in given:
        return given
    try:
        profile = ProfileValue().read(given["profile"], setting)
    except Misfit as error:
        raise Misfit([(("profile", *below), text) for below, text in error.faults]) from None
    except ValueError as error:
        raise Misfit([(("profile",), str(error))]) from None
    return {"length": profile.length, **given, "profile": profile}
