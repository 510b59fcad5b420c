"""Row of a sweep: a run of a case with values of keys, and its results as a dict."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fvsolve.case import Case, load
from fvsolve.case.reading import split_key
from fvsolve.core.output.summary_file import plain
from fvsolve.errors import CaseError
from fvsolve.studies.outcome import NO_FIELDS, end_if_interrupted, has_diverged, refusal_text
from fvsolve.studies.parallel import PickledCase

LOST_REASON = "lost: the process of this run was killed repeatedly. Is there enough memory?"


@dataclass
class RowMaker:
    """Callable that runs a case with values of keys and returns the row of results.

    source : case as for `load`; base : overrides of all runs
    case, model : case and model of the first run, from which the cases and models of later runs are derived
    """

    source: Any
    base: dict[str, Any]
    case: Case | None = field(default=None, compare=False)
    model: Any = field(default=None, compare=False)

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Row of the run with these values of keys; a refused case gives a row with its reason."""
        from fvsolve.core.output.memory_sink import MemorySink
        from fvsolve.core.run import model_of
        from fvsolve.core.solve import initial_state, solve

        try:
            model = model_of(self.read(values), like=self.model)
        except CaseError as error:
            return {"ok": False, "reason": refusal_text(error)}
        self.model, sink = self.model or model, MemorySink(model)
        summary = solve(model, initial_state(model), sink)
        end_if_interrupted(summary.reason)
        return row_of(model, summary, sink)

    def read(self, values: Mapping[str, Any]) -> Case:
        """Case with these values; later cases are derived from the first."""
        if self.case is None:
            self.case = load(self.source, {**self.base, **values, **NO_FIELDS})
            return self.case
        # keys of a table may conflict: overrides of `base` in the tables that change, and in [exact], are set again
        tables = {("exact",), *(split_key(key)[:2] for key in values)}
        base = {
            key: value
            for key, value in self.base.items()
            if {split_key(key)[:1], split_key(key)[:2]} & tables
        }
        return load(self.case, {**base, **values})

    def __getstate__(self) -> dict[str, Any]:
        """State for pickling; the other process reads the case again."""
        return {"sent": PickledCase(self.case or self.source), "base": self.base}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["sent"].source, state["base"])

    def lost_result(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Row of a run that crashed its process."""
        return {"ok": False, "reason": LOST_REASON}


def row_of(model, summary, sink) -> dict[str, Any]:
    """Row of a run: column -> value as in `summary.json`; see `Sweep` for the columns.

    None replaces values that are not finite, and all values of probes if the run diverged.
    sink : `MemorySink` with the output of the run
    """
    from fvsolve.core.run.verdicts import verdicts

    row = {"ok": bool(summary.ok), "reason": summary.reason, "t [s]": plain(float(summary.t))}
    row["marks"] = min(summary.marks, key=lambda mark: mark.time).text if summary.marks else ""
    row["warnings"] = [plain(column.plain()) for column in (*model.warnings, *summary.warnings)]
    row["fluid"] = plain(model.case.properties.plain())
    # values of a diverged run are meaningless
    blown, last = has_diverged(summary.reason), sink.last
    for k, column in enumerate(sink.columns):
        least, t_min, greatest, t_max = summary.extremes[column.name]
        name, unit = column.name, f"[{column.unit}]"
        entries = {f"min({name}) {unit}": column.from_si(least), f"t_min({name}) [s]": t_min}
        entries |= {f"max({name}) {unit}": column.from_si(greatest), f"t_max({name}) [s]": t_max}
        entries[f"final({name}) {unit}"] = last[1 + k]
        row |= {key: None if blown else plain(float(x)) for key, x in entries.items()}
    expectations = expectations_of(model, summary, sink)
    row["expectations"] = all(claim["ok"] for claim in expectations) if expectations else None
    row["verdicts"] = (
        all(column["ok"] for column in verdicts(model, summary)) if model.case.limits else None
    )
    return row | {"steps": summary.steps, "seconds": plain(float(summary.seconds))}


def expectations_of(model, summary, sink) -> list[dict[str, Any]]:
    """Expectations of the case with their results, as in the summary of a run; sink : output of the run."""
    from fvsolve.core.run import Result
    from fvsolve.core.run.verdicts import expectations

    columns = {column.name: column for column in sink.columns}
    probes = {
        name: {"dimension": column.dimension, "unit": column.unit}
        for name, column in columns.items()
    }
    summary_data = {
        "probes": probes,
        "time_unit": sink.time.unit,
        "ambient_pressure": model.case.ambient_pressure,
    }
    result = Result(summary_data, sink.table, sink.envelope)
    return expectations(model, summary, result)
