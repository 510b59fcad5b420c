"""Errors and computing times of models of a case, from rigid columns to many cells, with every density law.

A level of the hierarchy is a model of the case with a density law, set by overrides. Levels of pipes are rigid columns,
lumped volumes, delay lines, and few or many cells. Levels of tanks on moving bodies are frozen water (a rigid mass),
sloshing modes and cells. The level `richest` is the reference of all others. It has the most cells and the most
complete density law that runs.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.argument_checks import FUNCTION, NUMBER, TABLE, validated
from fvsolve.case.chainage import add_bends, placed
from fvsolve.case.reading import raw_link, with_defaults
from fvsolve.case.sloshing import slowest
from fvsolve.core.assembly.schedule_tables import value_at
from fvsolve.core.fluid import LAWS, law_named
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.steady_friction import drag
from fvsolve.core.model.model_facts import velocities
from fvsolve.core.output.result_table import PlainData
from fvsolve.declarations import declared
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.features.delay_lines.choice import reason_for_cells
from fvsolve.studies.distance import Deviation, moving_probes
from fvsolve.studies.outcome import GIVEN_UP, Outcome, capped, outcome, refuse_basins, study_model
from fvsolve.studies.reference import reference_of_run
from fvsolve.studies.resolution import refined_keys

SLOSHING = ("frozen", "modes", "cells")
MIN_REFINED_CELLS = 4  # sides of a tank with at most so many cells are not refined
CELL_NUMERICS = {"numerics.method": "ssp-rk3", "numerics.courant": 0.7}
LUMPED_NUMERICS = {"numerics.method": "auto", "numerics.rtol": 1e-7}


class NotApplicable(Exception):
    """Raised, with the reason, if a case cannot be turned into a model level."""


def level_names(case) -> list[str]:
    """Names of the model levels of a case, such as "rigid column", simplest first."""
    pipes = [link for link in case.links.values() if link.kind == "pipe"]
    if sloshing_basins(case):
        return list(SLOSHING)
    if not pipes:
        return ["as it is"]
    greatest = max(pipe.cells for pipe in pipes)
    counts = [2**k for k in range(20) if 2 ** (k + 1) <= greatest]
    cells = [f"{count} cell{'s' * (count > 1)}" for count in counts]
    return [
        "rigid column",
        "lumped volume",
        "column and volume",
        "delay lines",
        *cells,
        "full line",
    ]


def sloshing_basins(case) -> dict[str, Any]:
    """Basins with a free surface that are mounted on bodies: name -> node."""
    basins = {name: node for name, node in case.nodes.items() if node.kind == "basin"}
    return {name: node for name, node in basins.items() if node.on and node.physics_type.has_modes}


def level_keys(case, level: str) -> dict[str, Any]:
    """Overrides that turn a case into the model level with this name. Raises NotApplicable if this is impossible."""
    if level in ("full line", "as it is"):
        return {}
    if sloshing_basins(case):
        return sloshing_keys(case, level)
    pipes = {name: link for name, link in case.links.items() if link.kind == "pipe"}
    if level.endswith("times the cells"):
        factor, step = int(level.split()[0]), case.numerics.step
        keys = {f"links.{name}.cells": factor * pipe.cells for name, pipe in pipes.items()}
        return keys if step is None else keys | {"numerics.step": step / factor}
    if level == "delay lines":
        for name, pipe in pipes.items():
            if reason := reason_for_cells(case, name, pipe):
                raise NotApplicable(f"{name} cannot be a delay line: {reason}")
        return {f"links.{name}.pipe_model": "delay-line" for name in pipes}
    if level.endswith(("cell", "cells")):
        count, greatest = int(level.split()[0]), max(pipe.cells for pipe in pipes.values())
        return {
            f"links.{name}.cells": max(1, round(pipe.cells * count / greatest))
            for name, pipe in pipes.items()
        }
    keys = {"expect": {}, "compare": {}, "routes": {}, "limits": {}, **LUMPED_NUMERICS}
    keys["output.probes"] = [
        probe.text
        for probe in case.output.probes
        if probe.part != "links" or probe.name not in pipes or probe.text == f"{probe.name}.flow"
    ]
    if level != "lumped volume":
        keys |= {f"links.{name}": rigid_column(case, name) for name in pipes}
    else:
        model = study_model(case)
        keys |= {f"links.{name}": orifice_of(case, model, name) for name in pipes}
    if level != "rigid column":
        keys |= junction_chambers(case, pipes)
    return keys


def sloshing_keys(case, level: str) -> dict[str, Any]:
    """Overrides that turn a case with tanks on bodies into the model level with this name.

    All tanks have frozen water, sloshing modes or cells. The cells are those of the case, or a multiple of them along
    sides with more than `MIN_REFINED_CELLS` cells.
    """
    basins, keys = sloshing_basins(case), {"expect": {}, "compare": {}, "routes": {}, "limits": {}}
    if level in ("frozen", "modes"):
        quantities = {"frozen": (), "modes": ("depth",)}[level]
        probes = [
            entry
            for entry in case.output.probes
            if entry.name not in basins or entry.quantity in quantities
        ]
        keys["output.probes"] = [entry.text for entry in probes]
        return keys | {f"nodes.{name}.sloshing": level for name in basins} | LUMPED_NUMERICS
    keys |= {f"nodes.{name}.sloshing": "cells" for name in basins}
    if any(basin.lumped for basin in basins.values()):
        keys |= CELL_NUMERICS
    if level == "cells":
        return keys
    factor, step = int(level.split()[0]), case.numerics.step
    keys |= {
        f"nodes.{name}.cells": [
            factor * entry if entry > MIN_REFINED_CELLS else entry for entry in basin.cells
        ]
        for name, basin in basins.items()
    }
    return keys if step is None else keys | {"numerics.step": step / factor}


def rigid_column(case, name: str) -> dict[str, Any]:
    """Table of the case (key -> value) that describes a pipe as a rigid column."""
    names = ("from", "to", "length", "diameter", "friction", "minor_loss", "initial_flow")
    raw = {"diameter": case.links[name].diameter, **raw_link(case.raw, name)}
    table = {"type": "rigid-column", **{key: raw[key] for key in names if key in raw}}
    # a rigid column has no unsteady friction
    if table.get("friction", {}).get("model") == "unsteady":
        friction = {
            key: value for key, value in table["friction"].items() if key in ("roughness", "factor")
        }
        table["friction"] = {"model": "quasi-steady", **friction}
    return table


def orifice_of(case, model, name: str) -> dict[str, Any]:
    """Table of the case (key -> value) for an orifice with the friction loss of a pipe at its initial flow.

    The loss is dp = zeta rho v^2 / 2, with loss coefficient zeta, density rho and velocity v. Raises NotApplicable if
    zeta is not known or not positive.
    """
    row = model.tables.pipes[[pipe.name for pipe in model.pipes].index(name)]
    law = [row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds")]
    flow = float(row["flow"])
    scale = 2.0 * model.case.properties.density * row["area"] * case.links[name].length
    if law[0] not in (rec.FRICTION_NONE, rec.FRICTION_FACTOR) and flow == 0.0:
        raise NotApplicable(f"{name} is at rest at the start, so its friction loss is not known")
    zeta = float(scale * (drag(*law, flow) / (abs(flow) * flow) if flow else row["loss"]))
    if not zeta > 0.0:
        raise NotApplicable(
            f"{name} has no friction, so there is no resistance between two volumes"
        )
    raw = {"diameter": case.links[name].diameter, **raw_link(case.raw, name)}
    return {
        "type": "orifice",
        "from": raw["from"],
        "to": raw["to"],
        "diameter": raw["diameter"],
        "loss_coefficient": zeta,
    }


def junction_chambers(case, pipes: dict) -> dict[str, Any]:
    """Overrides that turn junctions into chambers, each with half the volume of every adjacent pipe.

    Reservoirs, tanks and accumulators are kept. The volume of a chamber of the case is increased. Volumes of pipes are
    multiplied by beta / (rho a^2), so that the chambers, in which the bulk modulus of the fluid is beta, are as elastic
    as fluid and pipe wall together (density rho, wave speed a). Raises NotApplicable if a node cannot be
    a chamber, or if no node becomes one.
    """
    volume_of: dict[str, float] = {}
    fluid = case.properties
    for name, pipe in pipes.items():
        stiffness = fluid.density * case.wave_speed(name) ** 2
        half_volume = (
            0.125 * math.pi * pipe.diameter**2 * pipe.length * fluid.bulk_modulus / stiffness
        )
        for end in pipe.ports.values():
            volume_of[end] = volume_of.get(end, 0.0) + half_volume
    chambers = {}
    for name, volume in volume_of.items():
        node = case.nodes.get(name, case.places[name])
        if node.kind in ("reservoir", "tank", "accumulator"):
            continue
        if node.kind not in ("junction", "inflow", "chamber"):
            raise NotApplicable(f"a volume at {name} would replace the {node.kind}")
        if name not in case.nodes:
            raise NotApplicable(
                f"{name} is a chamber of a cylinder, to which no other volume can be added"
            )
        raw = with_defaults(case.raw, case.raw["nodes"][name])
        if node.kind == "inflow" or (node.kind == "junction" and np.any(node.demand.value != 0.0)):
            raise NotApplicable(f"flow enters or leaves at {name}, which a volume cannot represent")
        start_keys = {
            key: raw[key] for key in ("elevation", "position", "initial_pressure") if key in raw
        }
        own_volume = node.volume if node.kind == "chamber" else 0.0
        chambers[f"nodes.{name}"] = {"type": "chamber", "volume": own_volume + volume, **start_keys}
    if not chambers:
        raise NotApplicable(
            "all ends of the pipes are reservoirs, tanks or accumulators, so no node can take the pipes' volumes"
        )
    return chambers


DEFAULT_TARGET = 1e-2
# timed runs of a level; time of the first run above which it is not repeated [s]
BEST_OF, BRIEF_RUN = 3, 0.3
LEVEL_CPU_LIMIT = 8.0  # CPU time after which a level is given up [s]
STRAIN_FACTOR = 3.0  # a difference of the laws above this multiple of dp/K has another cause
LINES = ("delay lines", "linear")  # level and law with a bound of its own
LINE_REFINEMENT, LINE_SAFETY = 4.0, 1.5
DECIDED = 0.1  # own error of the reference, in targets, at which it is not refined further
# greatest number of doublings of the cells, to find the error of the richest level itself
MAX_DOUBLINGS = 6
REFINED_COST = 4.0  # ratio of computing times, for twice the cells and twice the steps
SCHEDULE_SAMPLES = 4001  # sample times of each schedule, to find its steepest slope


@dataclass(frozen=True)
class ModelLevel:
    """Level of the model hierarchy: a model of the case with its cost, and errors against `Hierarchy.richest`.

    name : name of the level, such as "rigid column"; law : density law; states : number of states
    errors : probe -> root mean square over time of the difference to the level `richest`, over the range of the probe
    [-]
    error : greatest of these errors; None if the level was skipped or failed, or has none of the probes
    reason : cause if `error` is None, otherwise empty
    greatest : greatest difference of any probe at any time, over its range [-]
    seconds : wall time of the steps [s], the best of three runs, or of a single run that takes long
    rhs : number of evaluations of the rates
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
        """Probe with the greatest error."""
        return max(self.errors, key=self.errors.get, default="")


@dataclass(frozen=True)
class LawDifference:
    """Difference between the results of the linear and of the most complete density law of a model hierarchy.

    probe : probe with the greatest difference; error : rms of its difference over time, over its range [-]
    start : its difference at the start, over its range [-]; moves : its range over its greatest absolute value [-]
    level : greatest pressure of a probe at the start, over the least effective bulk modulus rho a^2 of a pipe [-]
    swift : greatest dynamic pressure rho v^2 / 2 in a pipe at the start [Pa], which the linear law neglects
    """

    probe: str
    error: float
    start: float
    moves: float
    level: float
    swift: float


@dataclass(frozen=True)
class Hierarchy(PlainData):
    """Levels of the model hierarchy of a case, with rules of thumb for the choice of a model.

    rungs : all levels, simplest first; target : acceptable error [-]; cheapest : fastest level whose error plus
    `own_error` is within `target`, or `richest`
    richest : level that is the reference of all others, with the most cells and the most complete density law that
    runs; its cells are refined until its own error is within `target`
    travel_time : greatest travel time of a wave along a pipe [s]
    change_time : time of the fastest change of a schedule or a tripped pump [s], as from the function `change_time`
    strain : greatest change of pressure from the start, over the least effective bulk modulus of a pipe [-]; in a case
    without pipes, over the bulk modulus of the fluid
    law_difference : difference of the linear law from the law of `richest` for equal cells; None if `richest` has the
    linear law, or if the linear run failed or was not made
    own_error : approximate error of `richest` from its cells [-]; None without cells or without a finer run
    shallow_water : notes on shallow-water theory for tanks on bodies; case : the case, for units of texts
    """

    rungs: list[ModelLevel]
    richest: ModelLevel
    target: float
    cheapest: ModelLevel
    travel_time: float
    change_time: float
    strain: float
    law_difference: LawDifference | None
    own_error: float | None
    shallow_water: tuple[str, ...] = ()
    case: Any = field(default=None, repr=False)

    json = "target own_error travel_time change_time strain apart=law_difference thumb=rules rungs richest cheapest"

    @property
    def own_error_note(self) -> str:
        """Note on the error of the level `richest` itself because of its cells; empty if this level is "as it is"."""
        if self.richest.name == "as it is":
            return ""
        if self.own_error is None:
            return f"the error of {self.richest.name} itself is not known: the run with twice the cells failed"
        text = (
            f"{self.richest.name} itself has an error of about {self.own_error:.2g} from its cells"
        )
        if self.own_error <= self.target:
            return text
        return (
            f"{text}, more than the target, so all errors of the table have at least this uncertainty; "
            "try `fvsolve order` to see how this error falls with more cells"
        )

    @property
    def rules(self) -> list[str]:
        """Rules of thumb for the choice of a model, in words."""
        rules = [*self.shallow_water]
        if self.law_difference is not None:
            rules.append(self._law_rule(self.law_difference))
        if self.travel_time > 0.0 and math.isfinite(self.change_time):
            ratio = self.change_time / self.travel_time
            kind = (
                "waves matter"
                if ratio < 2.0
                else "waves fade"
                if ratio < 20.0
                else "waves hardly matter"
            )
            crossing, change = (
                self.case.amount(time, "time", 3) for time in (self.travel_time, self.change_time)
            )
            rules.append(
                f"a wave travels along a pipe for up to {crossing}; the fastest input changes in {change}, "
                f"{ratio:.3g} times as long: {kind}"
            )
        return [*rules, self.own_error_note] if self.own_error_note else rules

    def _law_rule(self, apart: LawDifference) -> str:
        """Rule of thumb on the density law: compares the effect of the law with dp/K.

        apart : difference between the law `linear` and the most complete law; dp : greatest change of pressure;
        K : least effective bulk modulus
        """
        side = "within" if apart.error <= self.target else "above"
        text = f"linear differs from {self.richest.law} by {apart.error:.3g} of the range of {apart.probe}"
        text += f", {side} the target"
        if apart.error <= STRAIN_FACTOR * self.strain:
            return (
                f"dp/K = {self.strain:.2g} (greatest pressure change / bulk modulus): the laws differ by about "
                f"this fraction of a pressure change; here {text}"
            )
        reason = f"the difference is {apart.start:.3g} at the start and grows"
        if apart.start >= 0.5 * apart.error:
            reason = (
                f"the difference is already {apart.start:.3g} at the start, because at pressures of "
                f"{apart.level:.2g} times the bulk modulus the laws differ by this fraction, and the range of "
                f"{apart.probe} is only {apart.moves:.2g} of its value"
            )
        dynamic = self.case.amount(apart.swift, "pressure", 3, span=True)
        reason += (
            f"; linear neglects the dynamic pressure, {dynamic} at the start"
            if apart.swift > 0.0
            else ""
        )
        return f"{text}, more than dp/K = {self.strain:.2g} (greatest pressure change / bulk modulus): {reason}"


@declared("study")
@validated(set=TABLE, target=NUMBER, progress=FUNCTION)
def ladder(
    case,
    set: Mapping | None = None,
    target: float = DEFAULT_TARGET,
    progress: Callable[[int, int, str], None] | None = None,
) -> Hierarchy:
    """Run a case as rigid columns, lumped volumes, delay lines, few and many cells, with every possible density law.

    A case with water in tanks on bodies is run with frozen water, modes and cells, the same for all tanks.
    set : key -> value for all runs; target : acceptable error, relative to the range of a probe
    progress : called as progress(done, total, next)

    A level that does not suit the case is skipped, with a reason. The reference of all errors is the level with most
    cells, at least those of the case, and with the most complete density law that runs. Errors are those of the probes
    that a level has. Raises FvsolveError if the case itself does not run, if all its probes are constant, or if it has
    basins with cells that are not tanks on bodies.
    """
    from fvsolve.case import load

    case, report = load(case, dict(set or {})), progress or (lambda *_: None)
    if placed(add_bends(case.raw)):
        case = load(case.table())  # each pipe that placed parts or bends divide becomes its pieces
    refuse_basins(case, "chart --models", allow_sloshing=True)
    models = [(name, law) for name in level_names(case) for law in possible_laws(case)]
    runs, given_up = [], {}  # given_up: law -> level with cells that was given up under it
    for at, (name, law) in enumerate(models):
        report(at, len(models), f"{name}, {law}")
        reason = (
            f"not run: the run with {given_up[law]} was already given up" if law in given_up else ""
        )
        runs.append(Outcome(reason, refused=True) if reason else _run_level(case, name, law))
        if runs[-1].reason.startswith(GIVEN_UP) and name.endswith(("cell", "cells")):
            given_up[law] = name
    at = max(
        (k for k, entry in enumerate(runs) if entry.ok and models[k][0] == models[-1][0]),
        default=None,
    )
    if at is None:
        raise FvsolveError(f"the case itself does not run: {runs[-1].reason}")
    own_run, law = runs[at], models[at][1]

    def enough(reference: Outcome, own: float) -> bool:
        known = [
            _level_of(*names, entry, reference) for names, entry in zip(models, runs, strict=True)
        ]
        known = [entry for entry in known if not is_sure(entry, target, sure)]
        return own <= target and (own <= DECIDED * target or not undecided(known, target, own))

    of_law = {
        pair[1]: entry for entry, pair in zip(runs, models, strict=True) if pair[0] == models[at][0]
    }
    difference = law_difference(of_law.get("linear", own_run), own_run)
    sure = line_bound(
        case, dict(zip(models, runs, strict=True)), 0.0 if difference is None else difference.error
    )

    finer_runs, own = refine_richest(
        case,
        law,
        own_run,
        enough,
        lambda name: report(len(models), len(models) + 1, f"{name}, {law}"),
    )
    richest = finer_runs[-1][1] if finer_runs else own_run
    models = [*models, *((name, law) for name, _ in finer_runs)]
    runs = [*runs, *(entry for _, entry in finer_runs)]
    levels = [_level_of(*names, entry, richest) for names, entry in zip(models, runs, strict=True)]
    if all(entry.error is None for entry in levels):
        reason = "no probe changes, so models have no errors"
        raise FvsolveError(f"{reason}; try a probe that changes, or an input that does")
    top = levels[-1] if finer_runs else levels[at]
    accurate = [
        *within(levels, target, own or 0.0),
        *(entry for entry in levels if is_sure(entry, target, sure)),
        top,
    ]
    cheapest = min(accurate, key=lambda level: level.seconds)
    change = change_time(richest.model)
    travel = max((pipe.length / pipe.wave_speed for pipe in richest.model.pipes), default=0.0)
    strain = max((float(np.max(np.abs(p - p[0]))) for p in probe_pressures(richest)), default=0.0)
    strain /= least_stiffness(richest)
    notes = tuple(shallow_water_notes(case, target))
    return Hierarchy(
        levels, top, target, cheapest, travel, change, strain, difference, own, notes, case
    )


def refine_richest(
    case,
    law: str,
    own_run: Outcome,
    enough: Callable[[Outcome, float], bool],
    report: Callable[[str], None],
) -> tuple[list, float | None]:
    """Run levels with 2, 4, ... times the cells until the last level is accurate enough as a reference.

    own_run : run with the cells of the case; law : density law; report : called with the name of each level
    enough(run, error) : True if a run with this error needs no finer level

    Returns ([(name, run) of each finer level], error of the last of these levels, or of `own_run` without them).
    The error of a level is d / (1 - r), with its difference d to the next level and the ratio r of successive
    differences (1/2 for the first). The next level only serves to compute this error and is left out. If the next level
    cannot be run, the error is r d / (1 - r), with the difference d to the level before, or None if no finer level was
    run at all. There are no finer levels without pipes and tanks on bodies, and if such a tank states no cells.
    """
    runs = [("full line", own_run)]
    differences = []
    ratio = 0.5
    refinable = any(link.kind == "pipe" for link in case.links.values())
    if tanks := sloshing_basins(case):
        refinable = all(tank.cells for tank in tanks.values())
    for name in (
        [f"{2**k} times the cells" for k in range(1, MAX_DOUBLINGS + 1)] if refinable else []
    ):
        report(name)
        if REFINED_COST * runs[-1][1].processor > LEVEL_CPU_LIMIT:
            break
        run = _run_level(case, name, law)
        if not run.ok:
            break
        gaps = moving_probes(runs[-1][1], reference_of_run(run)).values()
        differences.append(max((_rms_error(gap) for gap in gaps), default=0.0))
        if len(differences) > 1 and differences[-2] > 0.0:
            ratio = min(max(differences[-1] / differences[-2], 0.1), 0.9)
        error = differences[-1] / (1.0 - ratio)
        if enough(runs[-1][1], error):
            return runs[1:], error
        runs.append((name, run))
    return runs[1:], differences[-1] * ratio / (1.0 - ratio) if differences else None


def line_bound(case, runs: dict[tuple[str, str], Outcome], law_error: float) -> float:
    """Bound of the error of the level "delay lines" without a reference of cells; inf if it is not known.

    It is the change by a fourth of the steps and of the delay tolerance, times a factor of safety, plus the difference
    of the laws. Cells smear jumps, so a reference of cells may have a greater error than this level.
    runs : (level, law) -> run; law_error : difference of the linear law from the law of the reference
    """
    from fvsolve.case import load

    own = runs.get(LINES)
    if own is None or not own.ok:
        return math.inf
    keys = {**level_keys(case, LINES[0]), "fluid.law": LINES[1]}
    finer_keys = keys | refined_keys(load(case, keys), LINE_REFINEMENT)
    finer = outcome(case, finer_keys, run=capped(LEVEL_CPU_LIMIT))
    if not finer.ok:
        return math.inf
    gaps = moving_probes(own, reference_of_run(finer)).values()
    return LINE_SAFETY * max((_rms_error(gap) for gap in gaps), default=math.inf) + law_error


def is_sure(level: ModelLevel, target: float, sure: float) -> bool:
    """True for the level "delay lines" if its own bound `sure`, as from `line_bound`, is within `target`."""
    return (level.name, level.law) == LINES and level.error is not None and sure <= target


def within(levels: list[ModelLevel], target: float, own: float) -> list[ModelLevel]:
    """Levels whose error is within `target`, for every possible reference; own : error of the reference."""
    return [entry for entry in levels if entry.error is not None and entry.error + own <= target]


def undecided(levels: list[ModelLevel], target: float, own: float) -> bool:
    """True if a level may be within `target` that is faster than all that are; own : error of the reference."""
    fastest = min((level.seconds for level in within(levels, target, own)), default=math.inf)
    near = [
        entry
        for entry in levels
        if entry.error is not None and target - own < entry.error <= target + own
    ]
    return any(entry.seconds < fastest for entry in near)


def possible_laws(case) -> list[str]:
    """Names of the density laws that are possible for a case; only the law of the case if it contains no fluid.

    Laws with keys of their own are possible only if the case states them.
    """
    from fvsolve.case import load

    if not case.places:
        return [case.fluid.law]
    names = [case.fluid.law]
    for law in LAWS.own():
        if law_named(law).keys:  # a law with keys is possible only as the case's own
            continue
        try:
            load(case, {"fluid.law": law})
        except CaseError:
            continue
        names.append(law)
    return [law for law in LAWS if law in names]


def _run_level(case, name: str, law: str) -> Outcome:
    """Outcome of the level `name` with a density law, or of the reason if the level does not suit the case."""
    try:
        keys = {**level_keys(case, name), "fluid.law": law}
        return outcome(case, keys, best_of=BEST_OF, run=capped(LEVEL_CPU_LIMIT), budget=BRIEF_RUN)
    except (CaseError, NotApplicable) as error:
        return Outcome(f"skipped: {error}", refused=True)


# errors of a level, and rules of thumb ------------------------------------------------------------------------


def _level_of(name: str, law: str, run: Outcome, richest: Outcome) -> ModelLevel:
    """`ModelLevel` from the run of the level `name` with a density law; errors are against the run `richest`."""
    if not run.ok:
        return ModelLevel(name, law, run.reason)
    gaps = moving_probes(run, reference_of_run(richest))
    errors = {name: _rms_error(gap) for name, gap in gaps.items()}
    worst = max(errors.values(), default=None)
    greatest = max((gap.ranges()["max"] for gap in gaps.values()), default=None)
    reason = "" if errors else "the model has none of the probes"
    return ModelLevel(
        name, law, reason, run.model.y_size, worst, greatest, errors, run.seconds, run.counts["rhs"]
    )


def _rms_error(gap: Deviation) -> float:
    return gap.ranges()["L2"]


def law_difference(linear: Outcome, richest: Outcome) -> LawDifference | None:
    """Difference of a run with the linear law from `richest`.

    It is None if both are the same, if the linear run failed, or if no probe changes.
    """
    gaps = (
        {}
        if linear is richest or not linear.ok
        else moving_probes(linear, reference_of_run(richest))
    )
    if not gaps:
        return None
    probe = max(gaps, key=lambda name: _rms_error(gaps[name]))
    values = richest.rows[:, 1 + richest.probes.index(probe)]
    level = max(
        (float(abs(change[0])) for change in probe_pressures(richest)), default=0.0
    ) / least_stiffness(richest)
    moves = float(np.ptp(values) / np.max(np.abs(values)))
    start = float(abs(gaps[probe].error[0]) / gaps[probe].span)
    model = richest.model
    swift = 0.5 * model.case.properties.density * float(velocities(model).max(initial=0.0)) ** 2
    return LawDifference(probe, _rms_error(gaps[probe]), start, moves, level, swift)


def shallow_water_notes(case, target: float) -> Iterator[str]:
    """Yield a note for each tank on a body: frequency error of its slowest sloshing mode in shallow-water theory.

    Tanks for which this error is not known are left out. target : acceptable error [-]
    """
    share = 100.0 * target
    for name, basin in sloshing_basins(case).items():
        mesh = {**case.meshes, **case.lumped}[name]
        if (mode := slowest(basin, mesh)) is not None:
            text = (
                f"{name}: its slowest wave, with k h = {mode.kh:.2g} (wave number times depth), is "
                f"{mode.excess:.2g} % too fast in shallow-water theory"
            )
            more = ", more than the target: modes are more accurate for small waves"
            yield text + more if mode.excess > share else text


def change_time(model) -> float:
    """Time of the fastest change [s]: range of a schedule over its steepest slope, or run-down time of a tripped pump.

    0 if a schedule jumps, infinite if nothing changes.
    """
    numerics = model.case.numerics
    if any(jump for t, jump in model.breaks if t > numerics.start):
        return 0.0
    times = np.unique(
        [
            *np.linspace(numerics.start, numerics.end, SCHEDULE_SAMPLES),
            *(t for t, _ in model.breaks),
        ]
    )
    trips = {
        name: link.trip
        for name, link in model.case.links.items()
        if getattr(link, "trip", None) is not None
    }
    quickest = math.inf
    for name, t in trips.items():
        # time in which the pump would stop under the torque that it has at its trip
        speed = float(model.case.links[name].speed.value[0])
        rate = model.rhs(t, np.zeros(model.y_size))[model.state_names.index(f"{name}.speed")]
        if rate != 0.0:
            quickest = min(quickest, speed / abs(rate))
    for index in range(len(model.tables.schedules)):
        if any(
            np.ptp(schedule_values(model, index, [math.nextafter(t, -math.inf), t]))
            for t in trips.values()
        ):
            continue  # a jump at the trip of a pump, whose run-down time counts instead
        values = schedule_values(model, index, times)
        steepest = float(np.max(np.abs(np.diff(values) / np.diff(times))))
        if steepest > 0.0:
            quickest = min(quickest, float(np.ptp(values)) / steepest)
    return quickest


def schedule_values(model, index: int, times) -> np.ndarray:
    """Values [SI] of the schedule with this index at the given times [s]."""
    return np.array([value_at(model.tables, index, t, np.inf) for t in times])


def probe_pressures(run: Outcome) -> list[np.ndarray]:
    """Pressures over time [Pa] of all pressure and head probes, float64[rows] each; a head h counts as rho g h."""
    weight = run.model.case.properties.density * run.model.case.gravity
    histories = []
    for k, probe in enumerate(run.model.case.probes, 1):
        if probe.quantity == "head" or probe.quantity.endswith("pressure"):
            histories.append(run.rows[:, k] * (weight if probe.quantity == "head" else 1.0))
    return histories


def least_stiffness(run: Outcome) -> float:
    """Least effective bulk modulus K = rho a^2 of a pipe [Pa]; without pipes the bulk modulus of the fluid."""
    fluid = run.model.case.properties
    return min(
        (fluid.density * pipe.wave_speed**2 for pipe in run.model.pipes), default=fluid.bulk_modulus
    )
