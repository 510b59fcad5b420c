"""The ladder of models of one case, from a rigid column to the full line, linear to tabled: what each one errs, costs.

Knows rungs and laws; leaves the runs to `outcome`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.case.placing import bent, placed
from fvsolve.case.sloshing import slowest
from fvsolve.doors import CALL, NUMBER, TABLE, door
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.fluid import LAWS
from fvsolve.kernels.schedules import value_until
from fvsolve.model.checks import velocities
from fvsolve.studies.accuracy.rungs import Unsayable, finer, restated, structures, tanks
from fvsolve.studies.accuracy.timing import GIVEN_UP, Capped
from fvsolve.studies.distance import Gap, moving
from fvsolve.studies.outcome import Outcome, outcome, without_basins
from fvsolve.studies.truth import of_run

TARGET = 1e-2
BEST_OF, BRIEF = 3, 0.3  # timings of a rung; [s] that the first may take for there to be others
PATIENCE = 8.0  # [s] of CPU time after which a rung is given up
BEYOND = 3.0  # times dp/K: from there on the laws differ by something else
DOUBLINGS = 6  # of the richest rung's cells, to see what it errs itself
DEARER = 4.0  # times, of twice the cells and twice the steps
SAMPLES = 4001  # of each schedule, to find how quickly it changes


@dataclass(frozen=True)
class Rung:
    """One model of the scene: its name and law, states, what it errs against the richest and what it costs.

    errors : of each probe, root mean square over time of the difference to the richest rung, over the range there [-]
    error : the greatest of them, None where the rung is skipped, and then `reason` says why
    greatest : the greatest difference at any time over the range, of all probes
    seconds : of stepping, best of three; rhs : calls of the rates
    """

    name: str
    law: str
    reason: str = ""
    states: int | None = None
    error: float | None = None
    greatest: float | None = None
    errors: dict[str, float] = field(default_factory=dict)
    seconds: float | None = None
    rhs: int | None = None

    @property
    def worst(self) -> str:
        """The probe that errs most."""
        return max(self.errors, key=self.errors.get, default="")


@dataclass(frozen=True)
class Apart:
    """How the linear law differs from the richest one, by the probe that shows it most, over its range [-].

    error : root mean square over time; start : at the start of the run; moves : the range over the greatest value [-]
    level : greatest pressure at the start over the stiffness [-]
    swift : velocity head of the quickest pipe at the start, rho v^2 / 2 [Pa], which the linear law leaves out
    """

    probe: str
    error: float
    start: float
    moves: float
    level: float
    swift: float


@dataclass(frozen=True)
class Ladder:
    """All rungs, poorest first, and what chooses among them.

    richest : the one that the others are measured against, refined until what it errs itself is within the target
    deep : of water in tanks that ride, how deep it is beside its longest waves, in words; case : whose units these use
    own : about what the richest errs by its cells [-], None where it has none or no finer one was run
    cheapest : the quickest rung whose error is within the target; travel_time : of a wave along the longest pipe [s]
    change_time : of the quickest schedule, its range over its steepest slope [s]
    strain : greatest change of pressure from the start over the stiffness of what it acts on [-]
    apart : how the linear law differs from the richest on its structure, None where it was not run
    """

    rungs: list[Rung]
    richest: Rung
    target: float
    cheapest: Rung
    travel_time: float
    change_time: float
    strain: float
    apart: Apart | None
    own: float | None
    deep: tuple[str, ...] = ()
    case: Any = field(default=None, repr=False)

    @property
    def worth(self) -> str:
        """What the errors mean, by the richest rung's own one; nothing where it has no cells."""
        if self.richest.name == "as it is":
            return ""
        if self.own is None:
            return f"what {self.richest.name} errs itself is not known: twice its cells could not be run"
        said = f"{self.richest.name} errs by about {self.own:.2g} itself, by its cells"
        if self.own <= self.target:
            return said
        return f"{said}: more than the target, so no error in this table is worth more; refine the case (fvsolve order)"

    @property
    def thumb(self) -> list[str]:
        """The rules of thumb that the choice follows."""
        found = list(self.deep) + ([] if self.apart is None else [self._of_laws(self.apart)])
        if self.travel_time > 0.0 and math.isfinite(self.change_time):
            ratio = self.change_time / self.travel_time
            kind = "waves matter" if ratio < 2.0 else "waves fade" if ratio < 20.0 else "waves hardly matter"
            crossing, change = (self.case.amount(one, "time", 3) for one in (self.travel_time, self.change_time))
            found.append(
                f"a wave crosses the longest pipe in {crossing}, what acts changes in "
                f"{change}, {ratio:.3g} times that: {kind}"
            )
        return [*found, self.worth] if self.worth else found

    def _of_laws(self, apart: Apart) -> str:
        side = "within" if apart.error <= self.target else "above"
        said = f"linear differs from {self.richest.law} by {apart.error:.3g} of the range of {apart.probe}"
        said += f", {side} the target"
        if apart.error <= BEYOND * self.strain:
            return f"dp/K = {self.strain:.2g}: of a change of pressure the laws differ by about that; here {said}"
        why = f"it is {apart.start:.3g} at the start and grows from there"
        if apart.start >= 0.5 * apart.error:
            why = f"{apart.start:.3g} is there from the start: pressures of {apart.level:.2g} K put the laws that far "
            why += f"apart, and all that {apart.probe} moves is {apart.moves:.2g} of itself"
        swift = self.case.amount(apart.swift, "pressure", 3, span=True)
        why += f"; linear leaves out the velocity head, {swift} at the start" if apart.swift > 0.0 else ""
        return f"{said}, more than dp/K = {self.strain:.2g}: {why}"

    def plain(self) -> dict[str, Any]:
        """As JSON says it."""
        own = {
            "target": self.target,
            "own_error": self.own,
            "travel_time": self.travel_time,
            "change_time": self.change_time,
        }
        laws = {"strain": self.strain, "apart": self.apart and vars(self.apart), "thumb": self.thumb}
        rungs = {"rungs": [vars(one) for one in self.rungs]}
        return own | laws | rungs | {"richest": vars(self.richest), "cheapest": vars(self.cheapest)}


@door(set=TABLE, target=NUMBER, progress=CALL)
def whole_pipes(case):
    """The case, of one whose pipes are cut by what stands along them the one that says their pieces."""
    from fvsolve.case import load

    return load(case.table()) if placed(bent(case.raw)) else case


def ladder(
    case,
    set: Mapping | None = None,
    target: float = TARGET,
    progress: Callable[[int, int, str], None] | None = None,
) -> Ladder:
    """Run a case as rigid columns, lumped volumes, few cells, many cells, under every law it can have.

    One with water that rides on bodies is run with it frozen, in modes, and in cells, all tanks alike.

    A rung that does not fit the scene is skipped and says why. The richest has the case's own cells and the richest law
    that runs; errors are of the probes that a rung has too. Raises FvsolveError where the case itself does not run, and
    where none of its probes moves.
    """
    from fvsolve.case import load

    case, tell = whole_pipes(load(case, dict(set or {}))), progress or (lambda *_: None)
    without_basins(case, "chart --models", riding=True)
    asked = [(rung, law) for rung in structures(case) for law in laws(case)]
    runs, dear = [], {}  # dear: law -> the rung with cells that was given up under it
    for at, (rung, law) in enumerate(asked):
        tell(at, len(asked), f"{rung}, {law}")
        late = f"not tried: already {dear[law]} was given up" if law in dear else ""
        runs.append(Outcome(late, refused=True) if late else _run(case, rung, law))
        if runs[-1].reason.startswith(GIVEN_UP) and rung.endswith(("cell", "cells")):
            dear[law] = rung
    at = max((k for k, one in enumerate(runs) if one.ok and asked[k][0] == asked[-1][0]), default=None)
    if at is None:
        raise FvsolveError(f"the case itself does not run: {runs[-1].reason}")
    whole, law = runs[at], asked[at][1]
    more, own = refined(case, law, whole, target, lambda rung: tell(len(asked), len(asked) + 1, f"{rung}, {law}"))
    richest = more[-1][1] if more else whole
    asked, runs = [*asked, *((rung, law) for rung, _ in more)], [*runs, *(one for _, one in more)]
    rungs = [_rung(*names, one, richest) for names, one in zip(asked, runs, strict=True)]
    able = [one for one in rungs if one.error is not None and one.error <= target]
    if not able:
        raise FvsolveError("no probe moves, so no model errs; probe what does, or let something act")
    cheapest = min(able, key=lambda one: one.seconds)
    travel, change = travel_time(richest.model), change_time(richest.model)
    plain = next((one for one, said in zip(runs, asked, strict=True) if said == (asked[at][0], "linear")), whole)
    top = rungs[-1] if more else rungs[at]
    about = travel, change, strain(richest), apart(plain, whole), own, tuple(said_of_tanks(case, target))
    return Ladder(rungs, top, target, cheapest, *about, case)


def refined(case, law: str, whole: Outcome, target: float, tell: Callable[[str], None]) -> tuple[list, float | None]:
    """(rungs with 2, 4, ... times the cells as (name, run), own error of the last of them, or of `whole` without any).

    The error of a rung is its difference d to the next over 1 - r, where differences fall by r each time, 1/2 until
    there are two. The rung that only served to find it is left out. Ends where the error is within the target, or a
    finer one cannot be run: then the last rung errs about r times as much as the one before.
    """
    runs, gaps, ratio = [("full line", whole)], [], 0.5
    for name in finer(case, DOUBLINGS):
        tell(name)
        if DEARER * runs[-1][1].processor > PATIENCE:
            break
        one = _run(case, name, law)
        if not one.ok:
            break
        gaps.append(max((_rms(gap) for gap in moving(runs[-1][1], of_run(one)).values()), default=0.0))
        if len(gaps) > 1 and gaps[-2] > 0.0:
            ratio = min(max(gaps[-1] / gaps[-2], 0.1), 0.9)
        if gaps[-1] <= target * (1.0 - ratio):
            return runs[1:], gaps[-1] / (1.0 - ratio)
        runs.append((name, one))
    return runs[1:], gaps[-1] * ratio / (1.0 - ratio) if gaps else None


def laws(case) -> list[str]:
    """The density laws that its fluid can have; its own alone where no place holds any."""
    from fvsolve.case import load

    if not case.places:
        return [case.fluid.law]
    found = [case.fluid.law]
    for law in LAWS:
        if LAWS[law].keys:  # a case's own: without them it is another
            continue
        try:
            load(case, {"fluid.law": law})
        except CaseError:
            continue
        found.append(law)
    return [law for law in LAWS if law in found]


def _run(case, rung: str, law: str) -> Outcome:
    try:
        return outcome(case, {**restated(case, rung), "fluid.law": law}, best_of=BEST_OF, run=patient, budget=BRIEF)
    except (CaseError, Unsayable) as error:
        return Outcome(f"skipped: {error}", refused=True)


def patient(model, state, sink, progress) -> Capped:
    """A run of PATIENCE at most."""
    made = Capped(model, state, sink, progress)
    made.most_seconds = PATIENCE
    return made


# what a rung amounts to -------------------------------------------------------------------------------------


def _rung(name: str, law: str, one: Outcome, richest: Outcome) -> Rung:
    if not one.ok:
        return Rung(name, law, one.reason)
    gaps = moving(one, of_run(richest))
    errors = {name: _rms(gap) for name, gap in gaps.items()}
    worst = max(errors.values(), default=None)
    greatest = max((gap.ranges()["max"] for gap in gaps.values()), default=None)
    reason = "" if errors else "none of the probes is left in it"
    return Rung(name, law, reason, one.model.y_size, worst, greatest, errors, one.seconds, one.counts["rhs"])


def _rms(gap: Gap) -> float:
    return gap.ranges()["L2"]


def apart(plain: Outcome, richest: Outcome) -> Apart | None:
    """How one law differs from another on the same structure; None where that is the same run, or one failed."""
    if plain is richest or not plain.ok:
        return None
    gaps = moving(plain, of_run(richest))
    probe = max(gaps, key=lambda name: _rms(gaps[name]))
    truth = richest.rows[:, 1 + richest.probes.index(probe)]
    level = max((float(abs(change[0])) for change in pressures(richest)), default=0.0) / stiffness(richest)
    moves = float(np.ptp(truth) / np.max(np.abs(truth)))
    start = float(abs(gaps[probe].off[0]) / gaps[probe].span)
    return Apart(probe, _rms(gaps[probe]), start, moves, level, velocity_head(richest.model))


def velocity_head(model) -> float:
    """Greatest rho v^2 / 2 of a pipe at the start [Pa]; 0 without pipes."""
    return 0.5 * model.case.properties.density * float(velocities(model).max(initial=0.0)) ** 2


def said_of_tanks(case, target: float) -> Iterator[str]:
    """Of water in tanks that ride, by how much shallow water runs too fast in its slowest mode, where that is known."""
    share = 100.0 * target
    for name, basin in tanks(case).items():
        mesh = {**case.meshes, **case.lumped}[name]
        if (found := slowest(basin, mesh)) is not None:
            said = (
                f"{name}: k h = {found.deep:.2g} of its slowest wave, which shallow water has {found.fast:.2g} % fast"
            )
            yield (
                f"{said}, more than the target: modes know better while waves are small" if found.fast > share else said
            )


def travel_time(model) -> float:
    """Of a wave along the pipe that takes it longest [s]; 0 without pipes."""
    return max((pipe.length / pipe.wave_speed for pipe in model.pipes), default=0.0)


def change_time(model) -> float:
    """Of what acts quickest: a schedule, its range over its steepest slope, or a pump that trips, by its run-down.

    0 where a schedule jumps, infinite where nothing acts [s].
    """
    numerics = model.case.numerics
    if any(jump for t, jump in model.breaks if t > numerics.start):
        return 0.0
    times = np.unique([*np.linspace(numerics.start, numerics.end, SAMPLES), *(t for t, _ in model.breaks)])
    trips = {name: link.trip for name, link in model.case.links.items() if getattr(link, "trip", None) is not None}
    quickest = min((run_down_time(model, name, t) for name, t in trips.items()), default=math.inf)
    for index in range(len(model.tables.schedules)):
        if any(np.ptp(given(model, index, [before(t), t])) for t in trips.values()):
            continue  # it says that a pump has tripped
        values = given(model, index, times)
        steepest = float(np.max(np.abs(np.diff(values) / np.diff(times))))
        if steepest > 0.0:
            quickest = min(quickest, float(np.ptp(values)) / steepest)
    return quickest


def given(model, index: int, times) -> np.ndarray:
    """Values of a schedule at times."""
    return np.array([value_until(model.tables.schedules, model.tables.pieces, index, t, np.inf) for t in times])


def before(t: float) -> float:
    """A time just before another [s]."""
    return math.nextafter(t, -math.inf)


def run_down_time(model, name: str, t: float) -> float:
    """In which a pump that trips would stand still, were its torque to stay [s]."""
    rate = model.rhs(t, np.zeros(model.y_size))[model.state_names.index(f"{name}.speed")]
    return float(model.case.links[name].speed.value[0]) / abs(rate) if rate != 0.0 else math.inf


def strain(one: Outcome) -> float:
    """Greatest change of a pressure or head probe from the start, over the stiffness [-]."""
    return max((float(np.max(np.abs(p - p[0]))) for p in pressures(one)), default=0.0) / stiffness(one)


def pressures(one: Outcome) -> list[np.ndarray]:
    """What its probes show of pressure, a head as rho g h [Pa]."""
    weight = one.model.case.properties.density * one.model.case.gravity
    found = []
    for k, probe in enumerate(one.model.case.probes, 1):
        if probe.quantity == "head" or probe.quantity.endswith("pressure"):
            found.append(one.rows[:, k] * (weight if probe.quantity == "head" else 1.0))
    return found


def stiffness(one: Outcome) -> float:
    """Of the softest pipe, wall and all, K = rho a^2; the fluid's own bulk modulus without pipes [Pa]."""
    fluid = one.model.case.properties
    return min((fluid.density * pipe.wave_speed**2 for pipe in one.model.pipes), default=fluid.bulk_modulus)
