"""Work-precision study: error against CPU time and cell updates, over schemes, methods and resolutions.

A setting is a scheme, a method and a resolution; a point is a setting with the results of its run. A curve consists of
the points of one scheme and method, from coarse to fine. A target error is a trajectory error: the mean error over time
of the worst probe, relative to its range.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cached_property
from pathlib import Path

from fvsolve.argument_checks import NAMES, NUMBER, NUMBERS, PATH, validated
from fvsolve.case import load
from fvsolve.case.case import Case
from fvsolve.core.steppers.tableau import AUTO, BUILT_IN, METHODS
from fvsolve.declarations import declared
from fvsolve.errors import CaseError, FvsolveError, listing
from fvsolve.studies.accuracy.chart_settings import (
    CoarseRun,
    MethodSetting,
    cell_keys,
    chart_settings,
    check_names,
    default_curve,
    is_adaptive,
    main_part_name,
    run_coarse,
    unsupported_schemes,
)
from fvsolve.studies.accuracy.work_precision import (
    Chart,
    Point,
    TargetSetting,
    cheapest_curve,
    coarser_setting,
    curves_by_name,
    front_row,
    good_errors,
    interpolated_setting,
    target_powers,
)
from fvsolve.studies.distance import Distance, distance, moving_probes
from fvsolve.studies.outcome import (
    GIVEN_UP,
    STUDY_ARGUMENTS,
    Progress,
    best_run_of,
    compile_seconds,
    name_list,
    study_model,
)
from fvsolve.studies.parallel import RunQueue, RunRequest
from fvsolve.studies.reference import Reference, find_reference
from fvsolve.studies.resolution import (
    as_cells,
    basins_from_files,
    cells_for_lines,
    delay_lines,
    fixed_choices,
)
from fvsolve.studies.result_cache import ResultCache

WRONG_ERROR = 1.0  # errors above the range of the component are wrong results


@declared("study")
@validated(
    schemes=NAMES,
    methods=NAMES,
    cells=NUMBERS,
    rtol=NUMBERS,
    step=NUMBERS,
    target=NUMBER,
    out=PATH,
    **STUDY_ARGUMENTS,
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
    """Run a case with all combinations of schemes, methods and cells (or tolerances); compare errors with their cost.

    schemes, methods : names (default a selection)
    cells : numbers of cells of the main part (`main_part_name`): of the pipe with the longest travel time, or along the
    side of a basin with most cells
    rtol, step : tolerances [-] and steps [s] of a case without cells; if all its pipes are delay lines, steps only
    target : mean error over time of the worst probe, relative to its range [-]; the cheapest setting with at most this
    error is found and run
    out : folder in which finished points are stored and found again; progress : progress(done, total, next)
    jobs, dask : processes that make the runs, as in `sweep`; runs take longer in processes that share cache and memory
    Raises CaseError, FvsolveError.
    """
    base_case, report = load(case, set), progress or (lambda *_: None)
    base_case = load(base_case, fixed_choices(base_case)) if fixed_choices(base_case) else base_case
    with ResultCache(out) as points, RunQueue(base_case, jobs, dask) as queue:
        return _ChartStudy(base_case, points, report, queue).run(
            schemes, methods, cells, rtol, step, target
        )


class _ChartStudy:
    """Work-precision study of a case: makes the runs, the reference and the chart.

    points : cache of results of earlier runs; queue : `RunQueue` that makes the runs
    Raises FvsolveError if the mesh of a basin comes from a file.
    """

    def __init__(
        self, case: Case, points: ResultCache, progress: Progress, queue: RunQueue
    ) -> None:
        self.case, self.queue = case, queue
        if basins_from_files(self.case):
            reason = f"chart refines cells, but the mesh of {listing(basins_from_files(self.case))} is a file"
            raise FvsolveError(f"{reason}; try order --refine time, which keeps the cells")
        self.points, self.progress = points, progress
        self.case_in_cells = load(case, as_cells(delay_lines(case))) if delay_lines(case) else case
        self.default, self.compiling = default_curve(self.case), 0.0
        self.coarse: CoarseRun | None = None  # of a case with cells or delay lines
        self.done, self.total, self.least_overshoot = 0, 0, 0.0
        self.given_up: dict[tuple, str] = {}  # curve -> resolution of the run that was given up

    def run(self, schemes, methods, cells, rtol, step, target) -> Chart:
        """Run all settings, and further settings for the target error if there is one; arguments as for `chart`."""
        schemes, methods = name_list(schemes), name_list(methods)
        check_names(schemes, methods)
        if main_part_name(self.case_in_cells):
            coarse_case = self.case if main_part_name(self.case) else self.case_in_cells
            # cached, so that a repeated study has the same numbers of cells
            key = {"study": "chart", "coarse": True}
            self.coarse = CoarseRun(
                **self.points.get(self.case, key, lambda: asdict(run_coarse(coarse_case)))
            )
            self.compiling += self.coarse.compile_seconds
        self.all = chart_settings(self.case, self.coarse, schemes, methods, cells, rtol, step)
        self.finest = max((entry.cells for entry in self.all if entry.cells), default=None)
        self.total = len(self.all) + 1
        floor = self.floor()
        self.least_overshoot = floor["overshoot"] or 0.0
        self.run_ahead()
        points, least = [self.point(setting) for setting in self.all], floor["trajectory"]
        if target is not None:
            points = self.add_coarser(points, target)
        if all(point.trajectory < least for point in points if point.ok):
            raise FvsolveError(_useless_text(self.case, points, floor))
        rows = [
            front_row(points, entry, least, self.default)
            for entry in target_powers(good_errors(points), least)
        ]
        target_setting = None if target is None else self.reach_target(points, target, floor)
        return Chart(
            self.case.name,
            points,
            floor["reference"],
            floor["second"],
            floor,
            self.default,
            self.compiling,
            rows,
            self.points.reused,
            target_setting,
            tuple(floor["told"]),
            tuple(unsupported_schemes(self.case, schemes)),
        )

    @cached_property
    def reference(self) -> Reference:
        """Reference of all settings, computed at its first use, after compilation for all schemes and methods.

        Raises FvsolveError if all probes are constant, and if `find_reference` finds no reference.
        """
        for setting in {entry.curve: entry for entry in reversed(self.all)}.values():
            self.progress(self.done, self.total, f"compiling {setting.name}")
            self.compiling += self.compile(setting)
        stiff = self.coarse is not None and self.coarse.stiff
        reference = find_reference(
            self.case,
            self.finest_keys(),
            stiff=stiff,
            progress=lambda name: self.progress(self.done, self.total, f"reference {name}"),
            queue=self.queue,
        )
        if not moving_probes(reference.run, reference):
            reason = "all probes are constant, so errors relative to their ranges do not exist"
            raise FvsolveError(
                f"{self.case.name}: {reason}; try a probe that changes, or a longer run"
            )
        return reference

    def finest_keys(self) -> dict | None:
        """Overrides with the finest cells under study, for the references; None without cells and delay lines.

        Delay lines get cells that a wave crosses in at most the time in which it crosses the finest cells.
        """
        if not delay_lines(self.case):
            return None if self.finest is None else cell_keys(self.case, self.finest)
        main = main_part_name(self.case) or main_part_name(self.case_in_cells)
        cells = self.finest or max(self.coarse.levels)
        keys = cell_keys(self.case, cells) if self.finest else {}
        return keys | cells_for_lines(
            self.case, self.case.links[main].length / self.case.wave_speed(main) / cells
        )

    def floor(self) -> dict:
        """Uncertainty of the reference (see `Reference`), as plain data with the keys of `Distance`.

        It also has the descriptions `reference` and `second` of both references, and `told`, reasons of failed runs.
        """

        def make() -> dict:
            reference = self.reference
            texts = {
                "reference": reference.words,
                "second": reference.second,
                "told": reference.failures,
            }
            return texts | asdict(reference.uncertainty)

        floor = self.points.get(self.case, {"study": "chart", "floor": self.finest}, make)
        self.done += 1
        return floor

    def run_ahead(self) -> None:
        """Make the runs of all settings without cached results in other processes, and store their results."""
        if self.queue.in_process:
            return
        by_cost = sorted(self.all, key=lambda setting: (setting.cells or 0, -setting.size))
        new = [
            setting
            for setting in by_cost
            if self.points.find(self.case, self.cache_key(setting)) is None
        ]
        if not new:
            return
        self.reference  # noqa: B018  computes the reference first, with runs of its own
        requests = [RunRequest(best_run_of, setting.keys) for setting in new]
        for count, at in enumerate(self.queue.run_ahead(requests), 1):
            self.progress(self.done + count, self.total, f"{new[at].name}, {new[at].fineness}")
            self.points.get(
                self.case, self.cache_key(new[at]), lambda setting=new[at]: self.measure(setting)
            )

    def cache_key(self, setting: MethodSetting) -> dict:
        """Values that identify the cached result of a setting."""
        return {"study": "chart", "keys": setting.keys, "judged by": self.finest}

    def point(self, setting: MethodSetting) -> Point:
        """Setting with its result, from a run or the cache.

        It is not run if a cheaper setting with the same scheme and method was given up because of its CPU time. An
        overshoot below that of the method `floor` is set to 0.
        """
        self.progress(self.done, self.total, f"{setting.name}, {setting.fineness}")
        given_up = self.given_up
        if setting.curve in given_up:
            data = empty_point(
                f"not run: the run with {given_up[setting.curve]} was already given up"
            )
        else:
            data = self.points.get(
                self.case, self.cache_key(setting), lambda: self.measure(setting)
            )
        self.done += 1
        if data["reason"].startswith(GIVEN_UP) and cost_grows(setting):
            given_up[setting.curve] = setting.fineness
        values = {key: math.nan if value is None else value for key, value in data.items()}
        if values["overshoot"] < self.least_overshoot:
            values["overshoot"] = 0.0
        return Point(setting, **values)

    def add_coarser(self, points: list[Point], target: float) -> list[Point]:
        """Add coarser settings of each curve until the coarsest fails or exceeds the error `target`; returns all."""
        all_points = []
        for curve in curves_by_name(points).values():
            extended = list(curve)
            while extended[0].ok and extended[0].trajectory <= target:
                setting = coarser_setting(self.case, extended[0].setting)
                if setting is None:
                    break
                self.total += 1
                extended.insert(0, self.point(setting))
            all_points += extended
        return all_points

    def compile(self, setting: MethodSetting) -> float:
        """Time of compilation for a setting [s]: a first run minus a second; 0 if the case cannot have the setting."""
        try:
            return compile_seconds(study_model(self.case, setting.keys))
        except CaseError:
            return 0.0

    def measure(self, setting: MethodSetting) -> dict:
        """Results of the run of a setting, as fields of `Point`: errors and cost, or the reason of a failure."""
        reference = self.reference
        run = self.queue(self.case, RunRequest(best_run_of, setting.keys))
        if run.refused:
            return empty_point(run.reason)
        errors = asdict(distance(run, reference))
        ok, reason = run.ok, run.reason
        if ok and not errors["trajectory"] <= WRONG_ERROR:
            ok = False
            reason = f"wrong: the error is {errors['trajectory']:.3g} times the range of {errors['worst']}"
        cost = {"seconds": run.processor, "rhs": run.counts["rhs"], "updates": run.cell_updates}
        return {"ok": ok, "reason": reason, **errors, **cost, "steps": run.counts["steps"]}

    def reach_target(self, points: list[Point], target: float, floor: dict) -> TargetSetting:
        """Cheapest setting for a target error, run and refined until its error is within the target.

        points : settings with their results; target : trajectory error [-]; floor : as from the method `floor`
        Raises FvsolveError if the target is below the floor, or if no setting reaches it.
        """
        if not target >= floor["trajectory"]:
            raise FvsolveError(
                f"a target of {target:g} is below the floor: the two references ({floor['reference']}; "
                f"{floor['second']}) disagree by {floor['trajectory']:.2g}; try a larger target, or more cells "
                "if the case has cells"
            )
        best = cheapest_curve(points, target, floor["trajectory"], "seconds")
        if best is None:
            remedy = (
                "more cells"
                if self.finest
                else "shorter steps"
                if self.coarse
                else "a smaller rtol"
            )
            least = f"{min(good_errors(points)):.2g}"
            raise FvsolveError(
                f"no setting reaches an error of {target:g}; the least error is {least}; try {remedy}"
            )
        name, crossing = best
        curve = curves_by_name(points)[name]
        for share in (crossing.share, 0.5 * (1.0 + crossing.share)) if crossing.within else ():
            coarser, finer = curve[crossing.coarser].setting, curve[crossing.finer].setting
            point = self.point(interpolated_setting(self.case, coarser, finer, share))
            if point.ok and point.trajectory <= target:
                return _target_setting(target, point, self.case)
        return _target_setting(target, curve[crossing.finer], self.case)


def empty_point(reason: str) -> dict:
    """Results of a setting that is not run, as fields of `Point`: NaN or 0, and the reason."""
    cost = {"seconds": math.nan, "rhs": 0, "updates": 0, "steps": 0}
    return {"ok": False, "reason": reason, **asdict(Distance()), **cost}


def cost_grows(setting: MethodSetting) -> bool:
    """True if finer settings with the same scheme and method certainly cost more.

    False for adaptive implicit methods and `auto` without cells, which may be faster with a smaller tolerance.
    """
    if setting.cells is not None or setting.control == "step" or not is_adaptive(setting.method):
        return True
    return setting.method != AUTO and METHODS[setting.method].explicit


def _target_setting(target: float, point: Point, case: Case) -> TargetSetting:
    """`TargetSetting` of a point. A method that is read from a file is given by the path of the file.

    The path is relative to the folder of the case if the file lies below this folder.
    """
    keys, method = dict(point.setting.keys), point.setting.keys.get("numerics.method")
    path = Path(METHODS[method].source) if method in METHODS and method not in BUILT_IN else None
    if path is not None and path.is_file():
        folder = None if case.path is None else case.path.resolve().parent
        below = folder is not None and path.is_relative_to(folder)
        keys["numerics.method"] = path.relative_to(folder).as_posix() if below else str(path)
    numerics = {
        key.removeprefix("numerics."): value
        for key, value in keys.items()
        if key.startswith("numerics.")
    }
    others = {key: value for key, value in keys.items() if not key.startswith("numerics.")}
    return TargetSetting(target, point, numerics, others)


def _useless_text(case: Case, points: list[Point], floor: dict) -> str:
    """Message if all errors are below the difference of the two references; floor : as from `_ChartStudy.floor`."""
    least = min(good_errors(points), default=math.nan)
    errors = (
        f"all errors (least {least:.2g})"
        if math.isfinite(least)
        else "any useful error, and no run succeeded"
    )
    remedy = "a larger --rtol"
    if main_part_name(case):
        remedy = "fewer --cells (references have four times the cells of the finest run)"
    elif delay_lines(case):
        remedy = "a larger --step (if delay lines are exact, any step is accurate)"
    return (
        f"{case.name}: the two references ({floor['reference']}; {floor['second']}) disagree by "
        f"{floor['trajectory']:.2g}, more than {errors}; try {remedy}, or an earlier end of the run"
    )
