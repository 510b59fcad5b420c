"""What accuracy costs: error against time and work over schemes, methods and resolution. Knows runs; draws nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path

from fvsolve.case import load
from fvsolve.case.case import Case
from fvsolve.case.sections import DEFAULT_CELLS, DEFAULT_RTOL
from fvsolve.doors import CALL, COUNT, NAMES, NUMBER, NUMBERS, PATH, TABLE, TEXT, door
from fvsolve.errors import CaseError, FvsolveError, listing
from fvsolve.shown import Shown
from fvsolve.steppers.methods import AUTO, METHODS
from fvsolve.steppers.tableau import OWN
from fvsolve.studies.accuracy.cells import from_files
from fvsolve.studies.accuracy.front import FrontRow, Point, cheapest, coarser, curves, errors_of, row, setting_between
from fvsolve.studies.accuracy.pareto import targets
from fvsolve.studies.accuracy.plan import Coarse, coarse, default_curve, known, left_out, settings
from fvsolve.studies.accuracy.setting import MethodSetting, adaptive, cell_keys, longest
from fvsolve.studies.accuracy.timing import GIVEN_UP, compile_seconds, quickest
from fvsolve.studies.distance import Distance, distance, moving
from fvsolve.studies.errands import Errand, Errands
from fvsolve.studies.lines import cells_for_lines, in_cells, lines, settled
from fvsolve.studies.outcome import Progress, names, prepared
from fvsolve.studies.points import Points
from fvsolve.studies.sheet import Column, Sheet
from fvsolve.studies.truth import Truth, truth

FRAME = (
    "scheme", "method", "cells", "size", "trajectory", "greatest", "end", "overshoot", "worst", "seconds", "updates",
    "steps", "ok", "reason",
)  # fmt: skip
WRONG = 1.0  # an error as great as all that the component does


@dataclass(frozen=True)
class Aim:
    """A setting that reaches a target, found and run: its point, and the lines that ask for it."""

    target: float
    point: Point
    numerics: dict
    others: dict  # dotted keys outside [numerics]

    def lines(self) -> list[str]:
        """TOML: keys of `[numerics]`, then the tables of pipes whose cells change."""
        found = [f"{key} = {toml(value)}" for key, value in self.numerics.items()]
        for key, value in self.others.items():
            table, _, name = key.rpartition(".")
            found += ["", f"[{table}]", f"{name} = {toml(value)}"]
        return found


@dataclass(frozen=True, repr=False)
class Chart(Shown):
    """Error against cost of a case, with the floor below which it means nothing."""

    case: str
    points: list[Point]
    reference: str
    second: str
    floor: dict
    default: str
    compile_seconds: float
    front: list[FrontRow]
    reused: int = 0
    aim: Aim | None = None
    told: tuple[str, ...] = field(default=())
    left_out: tuple[str, ...] = field(default=())  # schemes that do not follow the fluid

    picture = "fvsolve.studies.accuracy.files:figure"

    def said(self) -> str:
        return f"of {self.case!r}: {len(self.points)} points, {len(self.failed)} failed; default {self.default}"

    def listed(self) -> dict[str, list]:
        return Sheet([Column(key) for key in FRAME], self.rows).listed()

    @property
    def rows(self) -> list[dict]:
        """All points, each with what its setting says."""
        return [vars(one.setting) | vars(one) for one in self.points]

    def curves(self) -> dict[str, list[Point]]:
        """Points by name of scheme and method, from coarse to fine."""
        return curves(self.points)

    @property
    def stands(self) -> Point | None:
        """The program's defaults as they stand: 100 cells, or a tolerance of 1e-6; None where that was not run."""
        curve = self.curves().get(self.default, [])
        return next(
            (one for one in curve if DEFAULT_CELLS == one.setting.cells or one.setting.size == DEFAULT_RTOL), None
        )

    @property
    def failed(self) -> list[Point]:
        """Points without a usable answer."""
        return [point for point in self.points if not point.ok]

    def plain(self) -> dict:
        """All of it as dicts and lists, SI; the lines to paste as text."""
        stands = None if self.stands is None else asdict(self.stands)
        return asdict(self) | {"stands": stands} | ({} if self.aim is None else {"paste": "\n".join(self.aim.lines())})


@door(
    set=TABLE,
    schemes=NAMES,
    methods=NAMES,
    cells=NUMBERS,
    rtol=NUMBERS,
    step=NUMBERS,
    target=NUMBER,
    out=PATH,
    progress=CALL,
    jobs=COUNT,
    dask=TEXT,
)
def chart(
    case,
    set: Mapping | None = None,
    schemes: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
    cells: Sequence[int] | None = None,
    rtol: Sequence[float] | None = None,
    step: Sequence[float] | None = None,
    target: float | None = None,
    out: str | Path | None = None,
    progress: Progress | None = None,
    jobs: int = 1,
    dask: str | None = None,
) -> Chart:
    """Run a case over schemes x methods x cells (or tolerances) and lay error against cost.

    cells : of the pipe a wave takes longest to cross; rtol, step : of a case without cells [-], [s]; of one whose pipes
    are all delay lines step alone
    target : an error over the trajectory for which a setting is to be found and run
    out : folder where finished points are kept and found again
    jobs, dask : who makes the runs, as in `sweep`; processes that share a processor's cache and memory take longer each
    Raises CaseError, FvsolveError.
    """
    read, tell = load(case, set), progress or (lambda *_: None)
    read = load(read, settled(read)) if settled(read) else read
    with Points(out) as kept, Errands(read, jobs, dask) as errands:
        return _Study(read, kept, tell, errands).go(schemes, methods, cells, rtol, step, target)


def toml(value) -> str:
    """Text or a number as TOML writes it."""
    return f'"{value}"' if isinstance(value, str) else repr(value)


class _Study:
    """One chart while it is made."""

    def __init__(self, case: Case, points: Points, progress: Progress, errands: Errands) -> None:
        self.case, self.errands = case, errands
        if from_files(self.case):
            what = f"chart refines cells, and those of {listing(from_files(self.case))} are a file's"
            raise FvsolveError(f"{what}; order --refine time does without")
        self.points, self.progress = points, progress
        self.celled = load(case, in_cells(lines(case))) if lines(case) else case
        self.default, self.compiling = default_curve(self.case), 0.0
        self.coarse: Coarse | None = None  # with pipes
        self.done, self.total, self.least_overshoot = 0, 0, 0.0
        self.given_up: dict[tuple, str] = {}  # curve -> the fineness at which it was

    def go(self, schemes, methods, cells, rtol, step, target) -> Chart:
        schemes, methods = names(schemes), names(methods)
        known(schemes, methods)
        if longest(self.celled):
            self.coarse = Coarse(**self.points.get(self.case, {"study": "chart", "coarse": True}, self.coarsely))
            self.compiling += self.coarse.compile_seconds
        self.all = settings(self.case, self.coarse, schemes, methods, cells, rtol, step)
        self.finest = max((one.cells for one in self.all if one.cells), default=None)
        self.total = len(self.all) + 1
        floor = self.floor()
        self.least_overshoot = floor["overshoot"] or 0.0
        self.ahead()
        points, least = [self.point(setting) for setting in self.all], floor["trajectory"]
        if target is not None:
            points = self.downwards(points, target)
        if all(point.trajectory < least for point in points if point.ok):
            raise FvsolveError(_useless(self.case, points, floor))
        rows = [row(points, one, least, self.default) for one in targets(errors_of(points), least)]
        aim = None if target is None else self.aim(points, target, floor)
        return Chart(
            self.case.name, points, floor["reference"], floor["second"], floor, self.default, self.compiling, rows,
            self.points.reused, aim, tuple(floor["told"]), tuple(left_out(self.case, schemes)),
        )  # fmt: skip

    @cached_property
    def truth(self) -> Truth:
        """What judges, found only where some point is not known yet; what runs need is compiled before."""
        for setting in {one.curve: one for one in reversed(self.all)}.values():
            self.progress(self.done, self.total, f"compiling {setting.name}")
            self.compiling += self.compile(setting)
        stiff = self.coarse is not None and self.coarse.stiff
        found = truth(
            self.case, self.judged(), stiff=stiff,
            tell=lambda name: self.progress(self.done, self.total, f"reference {name}"), errands=self.errands,
        )  # fmt: skip
        if not moving(found.run, found):
            told = "every probe stands still, so an error has no range; probe what moves, or run longer"
            raise FvsolveError(f"{self.case.name}: {told}")
        return found

    def judged(self) -> dict | None:
        """Keys of the finest cells that references are to judge; delay lines are judged by as fine ones."""
        if not lines(self.case):
            return None if self.finest is None else cell_keys(self.case, self.finest)
        main, cells = longest(self.case) or longest(self.celled), self.finest or max(self.coarse.levels)
        keys = cell_keys(self.case, cells) if self.finest else {}
        return keys | cells_for_lines(self.case, self.case.links[main].length / self.case.wave_speed(main) / cells)

    def coarsely(self) -> dict:
        """The coarse run, kept, so that the same cells are found again."""
        return asdict(coarse(self.case if longest(self.case) else self.celled))

    def floor(self) -> dict:
        """What the references are called and how far they disagree."""

        def make() -> dict:
            found = self.truth
            said = {"reference": found.words, "second": found.second, "told": found.told}
            return said | asdict(found.doubt)

        found = self.points.get(self.case, {"study": "chart", "floor": self.finest}, make)
        self.done += 1
        return found

    def ahead(self) -> None:
        """Have others make the runs of all settings that are not known yet, and keep what they amount to."""
        if self.errands.alone:
            return
        dearest_last = sorted(self.all, key=lambda one: (one.cells or 0, -one.size))
        new = [one for one in dearest_last if self.points.find(self.case, self.extra(one)) is None]
        if not new:
            return
        self.truth  # noqa: B018  which has runs of its own made
        errands = [Errand(quickest, one.keys) for one in new]
        for count, at in enumerate(self.errands.ahead(errands), 1):
            self.progress(self.done + count, self.total, f"{new[at].name}, {new[at].fineness}")
            self.points.get(self.case, self.extra(new[at]), lambda one=new[at]: self.measure(one))

    def extra(self, setting: MethodSetting) -> dict:
        """What names a point beside the case."""
        return {"study": "chart", "keys": setting.keys, "judged by": self.finest}

    def point(self, setting: MethodSetting) -> Point:
        """A setting run and measured, or as it was found before; none that costs more than one that was given up."""
        self.progress(self.done, self.total, f"{setting.name}, {setting.fineness}")
        dearer = self.given_up
        if setting.curve in dearer:
            found = nothing(f"not tried: already {dearer[setting.curve]} was given up")
        else:
            found = self.points.get(self.case, self.extra(setting), lambda: self.measure(setting))
        self.done += 1
        if found["reason"].startswith(GIVEN_UP) and grows(setting):
            dearer[setting.curve] = setting.fineness
        told = {key: math.nan if value is None else value for key, value in found.items()}
        if told["overshoot"] < self.least_overshoot:
            told["overshoot"] = 0.0
        return Point(setting, **told)

    def downwards(self, points: list[Point], target: float) -> list[Point]:
        """All points, and before those of each curve that are all good enough coarser ones, until one is not."""
        found = []
        for curve in curves(points).values():
            wider = list(curve)
            while wider[0].ok and wider[0].trajectory <= target:
                setting = coarser(self.case, wider[0].setting)
                if setting is None:
                    break
                self.total += 1
                wider.insert(0, self.point(setting))
            found += wider
        return found

    def compile(self, setting: MethodSetting) -> float:
        """Seconds that the first run of a curve takes beyond its second; none for what is refused."""
        try:
            return compile_seconds(prepared(self.case, setting.keys))
        except CaseError:
            return 0.0

    def measure(self, setting: MethodSetting) -> dict:
        """What a point stores: errors and cost of a run, or why there are none."""
        judge, found = self.truth, self.errands(self.case, Errand(quickest, setting.keys))
        if found.refused:
            return nothing(found.reason)
        errors = asdict(distance(found, judge))
        ok, reason = found.ok, found.reason
        if ok and not errors["trajectory"] <= WRONG:
            ok, reason = False, f"wrong: off by {errors['trajectory']:.3g} times the range of {errors['worst']}"
        cost = {"seconds": found.processor, "rhs": found.counts["rhs"], "updates": found.cell_updates}
        return {"ok": ok, "reason": reason, **errors, **cost, "steps": found.counts["steps"]}

    def aim(self, points: list[Point], target: float, floor: dict) -> Aim:
        """The cheapest setting for a target, run; made finer until it holds."""
        if not target >= floor["trajectory"]:
            raise FvsolveError(
                f"a target of {target:g} lies below the floor: the two references ({floor['reference']}; "
                f"{floor['second']}) disagree by {floor['trajectory']:.2g}; ask for a larger one, or give more cells"
            )
        found = cheapest(points, target, floor["trajectory"], "seconds")
        if found is None:
            finer = "more cells" if self.finest else "shorter steps" if self.coarse else "a smaller rtol"
            raise FvsolveError(
                f"no setting reaches {target:g}; the best is at {min(errors_of(points)):.2g}: give {finer}"
            )
        name, where = found
        curve = curves(points)[name]
        for share in (where.share, 0.5 * (1.0 + where.share)) if where.within else ():
            made = self.point(
                setting_between(self.case, curve[where.coarser].setting, curve[where.finer].setting, share)
            )
            if made.ok and made.trajectory <= target:
                return _aim(target, made, self.case)
        return _aim(target, curve[where.finer], self.case)


def nothing(reason: str) -> dict:
    """What a point stores that was not run."""
    cost = {"seconds": math.nan, "rhs": 0, "updates": 0, "steps": 0}
    return {"ok": False, "reason": reason, **asdict(Distance()), **cost}


def grows(setting: MethodSetting) -> bool:
    """Whether the finer settings of a curve cost more: an implicit method may gain by a smaller tolerance."""
    if setting.cells is not None or setting.control == "step" or not adaptive(setting.method):
        return True
    return setting.method != AUTO and METHODS[setting.method].explicit


def _aim(target: float, point: Point, case: Case) -> Aim:
    keys = point.setting.keys
    if "numerics.method" in keys:
        keys = keys | {"numerics.method": _written(keys["numerics.method"], case)}
    own = {key.removeprefix("numerics."): value for key, value in keys.items() if key.startswith("numerics.")}
    return Aim(target, point, own, {key: value for key, value in keys.items() if not key.startswith("numerics.")})


def _written(method: str, case: Case) -> str:
    """A method as the case file says it: of a tableau in a file the path, relative to the case where it lies below."""
    path = Path(METHODS[method].source) if method in METHODS and method not in OWN else None
    if path is None or not path.is_file():
        return method
    folder = None if case.path is None else case.path.resolve().parent
    return path.relative_to(folder).as_posix() if folder and path.is_relative_to(folder) else str(path)


def _useless(case: Case, points: list[Point], floor: dict) -> str:
    finest = min(errors_of(points), default=math.nan)
    told = f"all errors (least {finest:.2g})" if math.isfinite(finest) else "what can be told, for no run came near"
    way = "a larger --step (where delay lines are exact any step will do)" if lines(case) else "a larger --rtol"
    way = "fewer --cells (references have four times the finest)" if longest(case) else way
    return (f"{case.name}: the two references ({floor['reference']}; {floor['second']}) disagree by "
            f"{floor['trajectory']:.2g}, more than {told}; try {way}, or end the run earlier")  # fmt: skip
