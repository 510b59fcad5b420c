"""The row of one run of a sweep: what the run was, found, and why it failed. Knows runs; knows no other row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fvsolve.case import Case, load
from fvsolve.case.raw import dotted
from fvsolve.errors import CaseError
from fvsolve.output.summary import plain
from fvsolve.studies.outcome import grown, refusal
from fvsolve.studies.sent import Sent

REFUSED = "refused: "
LOST = "lost: the process that ran it has ended, again and again; was memory too small?"
QUIET = {"output.fields": 0, "output.lines": {}}  # what no row shows


@dataclass
class RowMaker:
    """What makes rows of values of keys: of a case, with `base` set in all of them.

    source : what `load` takes; case, model : as they were made first, of which the others are made
    """

    source: Any
    base: dict[str, Any]
    case: Case | None = field(default=None, compare=False)
    model: Any = field(default=None, compare=False)

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The row of a run; a case that is refused has one too."""
        from fvsolve.output.memory import MemorySink
        from fvsolve.run import model_of
        from fvsolve.solve import initial_state, solve

        try:
            model = model_of(self.read(values), like=self.model)
        except CaseError as error:
            return {"ok": False, "reason": refusal(error)}
        self.model, sink = self.model or model, MemorySink(model)
        summary = solve(model, initial_state(model), sink)
        if summary.reason.startswith("interrupted"):
            raise KeyboardInterrupt
        return row_of(model, summary, sink)

    def read(self, values: Mapping[str, Any]) -> Case:
        """The case with these values; from the second on read by what is known of the first."""
        if self.case is None:
            self.case = load(self.source, {**self.base, **values, **QUIET})
            return self.case
        return load(self.case, {**self.beside(values), **values})

    def beside(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """What of `base` has to be said again with values: what stands in the same tables, which it may go against."""
        tables = {("exact",), *(dotted(key)[:2] for key in values)}
        return {key: one for key, one in self.base.items() if {dotted(key)[:1], dotted(key)[:2]} & tables}

    def __getstate__(self) -> dict[str, Any]:
        """For another process, which reads the case anew."""
        return {"sent": Sent(self.case or self.source), "base": self.base}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.source, self.base, self.case, self.model = state["sent"].source, state["base"], None, None

    def lost(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The row of a run that ends its process."""
        return {"ok": False, "reason": LOST}


def row_of(model, summary, sink) -> dict[str, Any]:
    """What a run has to say in one row, as its `summary.json` has it; None for what is not finite."""
    row = {"ok": bool(summary.ok), "reason": summary.reason, "t [s]": plain(float(summary.t))}
    row["marks"] = min(summary.marks, key=lambda mark: mark.time).text if summary.marks else ""
    row["warnings"] = [plain(one.plain()) for one in (*model.warnings, *summary.warnings)]
    row["fluid"] = plain(model.case.properties.plain())
    blown, last = grown(summary.reason), sink.last  # the numbers before it mean nothing
    for k, one in enumerate(sink.columns):
        least, t_least, greatest, t_greatest = summary.extremes[one.name]
        name, unit = one.name, f"[{one.unit}]"
        said = {f"min({name}) {unit}": one.from_si(least), f"t_min({name}) [s]": t_least}
        said |= {f"max({name}) {unit}": one.from_si(greatest), f"t_max({name}) [s]": t_greatest}
        said[f"final({name}) {unit}"] = last[1 + k]
        row |= {key: None if blown else plain(float(x)) for key, x in said.items()}
    claimed = claimed_of(model, summary, sink)
    row["expectations"] = all(claim["ok"] for claim in claimed) if claimed else None
    row["verdicts"] = all(one["ok"] for one in verdicts(model, summary)) if model.case.limits else None
    return row | {"steps": summary.steps, "seconds": plain(float(summary.seconds))}


def claimed_of(model, summary, sink) -> list[dict[str, Any]]:
    """What the case claims and whether it holds, as a run says it."""
    from fvsolve.run import Result
    from fvsolve.run.claims import expectations

    columns = {one.name: one for one in sink.columns}
    probes = {name: {"dimension": one.dimension, "unit": one.unit} for name, one in columns.items()}
    about = {"probes": probes, "time_unit": sink.time.unit, "ambient_pressure": model.case.ambient_pressure}
    result = Result(about, sink.table, sink.envelope)
    return expectations(model, summary, result)


def verdicts(model, summary) -> list[dict[str, Any]]:
    """Whether its limits hold, as a run says it."""
    from fvsolve.run.verdicts import verdicts

    return verdicts(model, summary)
