"""Batches of a sweep: variants of a case as copies of its network in one model, which one run steps together.

Copies do not touch each other and take the same steps, so each has the bits of a run of its own. A case is suited if
its steps do not depend on states: pipes with the density law `linear`, reservoirs, junctions and restrictions, and an
explicit method with a given step or Courant number. Delay lines are suited if no schedule jumps, because the greatest
jump of a model decides which jumps are followed. Variants may differ in numbers of parts that leave wave speeds as they
are, and in schedules with the same times of kinks and jumps. Variants of a batch that does not run to its end, or with
notices of its run, are run again, each alone.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from fvsolve.case import Case
from fvsolve.core.assembly.model_draft import ModelDraft
from fvsolve.core.assembly.schedule_tables import break_times
from fvsolve.core.model.build import (
    CHANGING_FIELDS,
    model_of,
    tables_before_start,
    tables_with_start,
    with_new_sizes,
)
from fvsolve.core.model.start_notices import start_notices
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve import initial_state, solve
from fvsolve.core.step_limits.growing_modes import states_outside_cells
from fvsolve.core.steppers.tableau import method_named
from fvsolve.errors import CaseError, Notice
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.table_model import Table
from fvsolve.studies.outcome import end_if_interrupted
from fvsolve.studies.sweep_row import RowMaker, row_of

SIZE = 32  # number of copies in a batch
LEAST = 8  # number of variants below which a batch takes more time than single runs
MOST_FAILED = 2  # number of failed batches in a row after which variants run alone
# suited kinds of parts
KINDS = {"nodes": {"reservoir", "junction"}, "links": {"pipe", "valve", "orifice"}}
UNSUITED = ("signals", "scalars", "controls", "reactions", "meshes", "lumped", "routes", "compare")
KINKED = ("constant", "linear", "smooth", "ramp", "step")  # schedules that `break_times` describes
UNCHANGED = [field.name for field in fields(Case) if field.name not in CHANGING_FIELDS]
# ending of the names of the parts of a copy; names in a case file have no ~
COPY = re.compile(r"~\d+~")


def ending(k: int) -> str:
    """Ending of the names of the parts of copy k."""
    return f"~{k}~"


def is_suited(model: Any) -> bool:
    """True if variants of the case of a model can be run in batches."""
    case, numerics = model.case, model.case.numerics
    if (
        numerics.rtol is not None
        or numerics.method == "auto"
        or not method_named(numerics.method).explicit
    ):
        return False
    others = (
        any(getattr(case, name) for name in UNSUITED)
        or case.exact
        or case.validation
        or case.needs_equilibrium
    )
    if others or numerics.below_vapor == "stop" or not case.law.linear:
        return False
    parts = [(group, name, part) for group in KINDS for name, part in getattr(case, group).items()]
    names = {name for _, name, _ in parts}
    kinds = all(part.kind in KINDS[group] for group, _, part in parts)
    kinds = kinds and all(probe.name in names for probe in case.probes)
    kinds = kinds and "auto" not in {
        numerics.pipe_model,
        *(getattr(part, "pipe_model", "") for _, _, part in parts),
    }
    return kinds and steps_without_states(model)


def steps_without_states(model: Any) -> bool:
    """True if the steps of a model of pipes and restrictions do not depend on its states."""
    if model.shapes.armed or len(model.devices) or states_outside_cells(model).size:
        return False
    has_lines = (model.tables.pipes["cells"] == 0).any()
    return not (has_lines and any(jump for _, jump in model.breaks))


def steps_alike(case: Case, other: Case) -> bool:
    """True if two cases differ only in numbers of parts, and in schedules with the same kinks and jumps."""
    pairs = [(getattr(case, name), getattr(other, name)) for name in UNCHANGED]
    same = all(before is now or before == now for before, now in pairs)
    return same and all(
        before.keys() == now.keys()
        and all(only_numbers_differ(part, now[name]) for name, part in before.items())
        for before, now in ((case.nodes, other.nodes), (case.links, other.links))
    )


def only_numbers_differ(before: Any, now: Any) -> bool:
    """True if two values of keys, or two parts, are equal or differ only as for `steps_alike`."""
    if before is now:
        return True
    if type(before) is not type(now):
        return False
    if isinstance(before, Schedule):
        kinked = before.kind == now.kind and before.kind in KINKED
        return before == now or (kinked and break_times(before) == break_times(now))
    if isinstance(before, Table):
        return all(
            only_numbers_differ(getattr(before, name), getattr(now, name))
            for name in type(before).model_fields
        )
    return isinstance(before, float) or (not isinstance(before, np.ndarray) and bool(before == now))


@dataclass
class DraftOfCopy:
    """Data of the draft of a copy for notices on the start."""

    case: Case
    pipe_names: list[str]
    pipe_table: np.ndarray
    column_names: list[str]
    column_table: np.ndarray
    fluid: Any
    meshes: list


@dataclass
class VariantModel:
    """Data of the model of a variant for its row of results; `computed` and `watched` are common to all variants."""

    case: Case
    probes: list
    computed: dict
    warnings: list[Notice]
    watched: list
    pipes: list = field(default_factory=list)
    elevation: dict[str, float] = field(default_factory=dict)
    isolated: frozenset[str] = frozenset()  # key paths of parts whose pressure no flow determines

    def head(self, pressure: np.ndarray, elevation: np.ndarray) -> np.ndarray:
        return self.case.law.head(pressure, elevation)


@dataclass
class VariantSink:
    """Output of the run of a variant for its row; rows : float64[rows, 1 + probes]  times and probe values."""

    columns: list
    time: Any
    rows: np.ndarray
    envelope: Callable[[], dict] = field(default=dict)

    def table(self) -> np.ndarray:
        return self.rows

    @property
    def last(self) -> np.ndarray:
        return self.rows[-1]


class Batch:
    """Model with copies of a network, used for any number of batches of its variants.

    model : model of the case from which the variants differ
    """

    def __init__(self, model: Any) -> None:
        self.case, self.breaks = model.case, (model.breaks, model.step_max)
        case, self.expect, self.computed, self.functions = model.case, {}, {}, None
        self.pipes, self.watched = [pipe.name for pipe in model.pipes], case.extreme_probes
        self.nodes = [
            {name: copied(part, k) for name, part in case.nodes.items()} for k in range(SIZE)
        ]
        self.links = [
            {name: copied(part, k) for name, part in case.links.items()} for k in range(SIZE)
        ]
        probes = [
            replace(probe, text=probe_text(probe, k), name=probe.name + ending(k))
            for k in range(SIZE)
            for probe in case.probes
        ]
        self.output = case.output.model_copy(update={"probes": probes, "fields": 0})
        self.extreme_probes = [
            replace(probe, text=probe_text(probe, k), name=probe.name + ending(k))
            for k in range(SIZE)
            for probe in self.watched
        ]
        self.tables = tables_before_start(self.joined([case] * SIZE))

    def joined(self, cases: Sequence[Case]) -> Case:
        """Case with the parts of `SIZE` variants; parts that do not differ are the same objects in every batch.

        It has no notices: those of the variants are used instead.
        """
        nodes, links = {}, {}
        for k, case in enumerate(cases):
            for found, own, base, parts in (
                (nodes, case.nodes, self.case.nodes, self.nodes[k]),
                (links, case.links, self.case.links, self.links[k]),
            ):
                for name, part in own.items():
                    found[name + ending(k)] = parts[name] if part is base[name] else copied(part, k)
        case = replace(
            self.case, nodes=nodes, links=links, output=self.output, expect=self.expect, limits={}
        )
        case.__dict__.update(notices=[], extreme_probes=self.extreme_probes)
        return case

    def rows(self, cases: Sequence[Case]) -> list[dict[str, Any]] | None:
        """Rows of results of at most `SIZE` variants; None if they must run alone."""
        if not all(steps_alike(self.case, case) for case in cases):
            return None
        try:
            draft, model = self.model(self.joined([*cases, *[self.case] * (SIZE - len(cases))]))
        except CaseError:
            return None
        if model is None:
            return None
        sink = MemorySink(model)
        summary = solve(model, initial_state(model), sink)
        end_if_interrupted(summary.reason)
        lists = [notices_of_copies(given) for given in (model.warnings, summary.marks)]
        # notices of a run name the worst part only
        if not summary.ok or summary.warnings or None in lists:
            return None
        lists[0] = [
            [*lists[0][k], *self.start_notices(case, k, draft)] for k, case in enumerate(cases)
        ]
        texts = [probe.text for probe in self.case.probes]
        self.columns = [
            column._replace(name=text) for column, text in zip(sink.columns, texts, strict=False)
        ]
        values = np.ascontiguousarray(sink.table().T)
        return [
            self.row(case, k, model, summary, sink.time, values, [given[k] for given in lists])
            for k, case in enumerate(cases)
        ]

    def model(self, joined: Case) -> tuple[ModelDraft, Any]:
        """Draft and model of `SIZE` variants; the model is None if their steps could differ.

        Raises CaseError if a variant has faults.
        """
        resized = with_new_sizes(self.tables, joined)
        draft = tables_with_start(joined, resized)
        model = model_of(draft, notices=lambda draft: [])
        rates = model.wave_rates.reshape(SIZE, -1)
        same = (model.breaks, model.step_max) == self.breaks and (rates == rates[0]).all()
        if (
            not same
            or not steps_without_states(model)
            or (resized is not None and draft is not resized)
        ):
            return draft, None
        if resized is not None:  # the compiled functions are those of the batch before
            if self.functions is not None and self.functions[0] == model.unsteady:
                model.__dict__["functions"] = self.functions[1]
            self.functions = model.unsteady, model.functions
        return draft, model

    def start_notices(self, case: Case, k: int, draft: ModelDraft) -> list[Notice]:
        """Notices on the start of copy k, as in a model of its own."""
        count = len(self.pipes)
        own = slice(k * count, (k + 1) * count)
        columns = draft.column_table[:0]
        return start_notices(
            DraftOfCopy(case, self.pipes, draft.pipe_table[own], [], columns, draft.fluid, [])
        )

    def row(
        self,
        case: Case,
        k: int,
        joined: Any,
        summary: Any,
        time: Any,
        values: np.ndarray,
        notices: list,
    ) -> dict:
        """Row of results of copy k.

        joined, summary : model of all copies, and the summary of its run; time : column of the time
        values : float64[1 + probes, rows]  times and probe values of the run
        notices : of the model of the copy, and its marks
        """
        probes = self.case.probes
        extremes = {probe.text: summary.extremes[probe_text(probe, k)] for probe in probes}
        own = replace(summary, extremes=extremes, seconds=summary.seconds / SIZE, marks=notices[1])
        model = VariantModel(
            case, probes, self.computed, [*case.notices, *notices[0]], self.watched
        )
        if self.watched:
            self.set_extents(model, own, k, joined, summary)
        model.isolated = frozenset(
            f"{group}.{name}"
            for group in ("nodes", "links")
            for name in getattr(case, group)
            if f"{group}.{name}{ending(k)}" in joined.isolated
        )
        rows = np.concatenate((values[:1], values[1 + k * len(probes) :][: len(probes)])).T
        return row_of(model, own, VariantSink(self.columns, time, rows))

    def set_extents(self, model: VariantModel, own: Any, k: int, joined: Any, summary: Any) -> None:
        """Set data of copy k from which limits, and expectations on whole parts, are evaluated.

        model, own : model and summary of the copy; joined, summary : those of all copies
        """
        first = k * len(self.pipes)
        model.pipes = [
            replace(joined.pipes[first + i], name=name) for i, name in enumerate(self.pipes)
        ]
        model.elevation = {name: joined.elevation[name + ending(k)] for name in self.case.nodes}
        own.watched = {probe.text: summary.watched[probe_text(probe, k)] for probe in self.watched}
        own.envelope = {name: summary.envelope[name + ending(k)] for name in self.pipes}
        own.points = {
            name: summary.points[key]
            for name in self.pipes
            if (key := name + ending(k)) in summary.points
        }


def copied(part: Any, k: int) -> Any:
    """Part of copy k: its ends are the nodes of that copy."""
    ends = {key: vars(part)[key] + ending(k) for key in ("from_", "to") if vars(part).get(key)}
    return part.model_copy(update=ends)


def probe_text(probe: Any, k: int) -> str:
    """Text of a probe of copy k."""
    before, _, after = probe.text.partition(probe.name)
    return f"{before}{probe.name}{ending(k)}{after}"


def notices_of_copies(notices: Sequence[Any]) -> list[list] | None:
    """Notices or marks of each copy, with the names of the case; None if one does not belong to a single copy."""
    found: list[list] = [[] for _ in range(SIZE)]
    for notice in notices:
        places, copies = COPY.findall(notice.place), {*COPY.findall(notice.place + notice.text)}
        if len(places) != 1 or len(copies) != 1:
            return None
        own = replace(
            notice,
            place=notice.place.replace(places[0], ""),
            text=notice.text.replace(places[0], ""),
        )
        found[int(places[0][1:-1])].append(own)
    return found


class BatchedRows:
    """Callable that returns the row of a run of a sweep; `results` computes many of them in batches.

    make : callable that computes a row alone
    """

    def __init__(self, make: RowMaker) -> None:
        self.make, self.batch, self.failed = make, None, 0

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        return self.make(values)

    def __getstate__(self) -> dict[str, Any]:
        return {"make": self.make, "batch": None, "failed": 0}

    def lost_result(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Row of a run that crashed its process."""
        return self.make.lost_result(values)

    def results(self, tasks: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
        """Rows of runs in order; the first runs alone, the others in batches where the case is suited.

        tasks : for each run the values of its keys
        """
        at = 0
        while at < len(tasks):
            own = tasks[at : at + (SIZE if len(tasks) - at >= LEAST and self.is_ready() else 1)]
            rows = self.together(own) if len(own) > 1 else {}
            for number, values in enumerate(own):
                yield rows[number] if number in rows else self.make(values)
            at += len(own)

    def is_ready(self) -> bool:
        """True if variants can be run in batches; makes the batch when it is first needed."""
        if self.make.model is None or self.failed >= MOST_FAILED:
            return False
        if self.batch is None:
            if is_suited(self.make.model):
                self.batch = Batch(self.make.model)
            else:
                self.failed = MOST_FAILED
        return self.batch is not None

    def together(self, tasks: Sequence[Mapping[str, Any]]) -> dict[int, dict[str, Any]]:
        """Rows of the tasks that a batch could run : number of the task -> row."""
        cases = {}
        for number, values in enumerate(tasks):
            try:
                cases[number] = self.make.read(values)
            except CaseError:  # it is refused alone, with its reason
                continue
        rows = self.batch.rows(list(cases.values())) if cases else None
        self.failed = self.failed + 1 if rows is None else 0
        return dict(zip(cases, rows or [], strict=False))
