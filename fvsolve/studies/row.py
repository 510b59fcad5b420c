"""The row of one run of a sweep: what the run was, found, and why it failed. Knows runs; knows no other row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fvsolve.case import Case, load
from fvsolve.case.raw import Raw, dotted
from fvsolve.errors import CaseError
from fvsolve.output.summary import plain
from fvsolve.studies.outcome import grown, refusal

REFUSED = "refused: "
LOST = "lost: the process that ran it has ended, again and again; was memory too small?"
QUIET = {"output.fields": 0, "output.lines": {}}  # what no row shows


@dataclass
class RowMaker:
    """What makes rows of values of keys: of a case, with `base` set in all of them.

    source : what `load` takes; case : it as it was read first, from which the others are read
    """

    source: Any
    base: dict[str, Any]
    case: Case | None = field(default=None, compare=False)

    def __call__(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The row of a run; a case that is refused has one too."""
        from fvsolve.run import run

        try:
            result = run(self.read(values))
        except CaseError as error:
            return {"ok": False, "reason": refusal(error)}
        if result.reason.startswith("interrupted"):
            raise KeyboardInterrupt
        return plain(row_of(result))

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
        """For another process: what the case says, not what it was read as, which may hold functions and meshes."""
        known = self.case or (self.source if isinstance(self.source, Case) else None)
        source = self.source if known is None else Raw(known.raw, known.name, known.path, known.folder)
        return {"source": source, "base": self.base, "case": None}

    def lost(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The row of a run that ends its process."""
        return {"ok": False, "reason": LOST}


def row_of(result) -> dict[str, Any]:
    """What a run has to say in one row."""
    row = {"ok": result.ok, "reason": result.reason, "t [s]": result.summary["t"]}
    row["marks"] = min(result.marks, key=lambda mark: mark.time).text if result.marks else ""
    row |= {key: result.summary[key] for key in ("warnings", "fluid")}
    blown = grown(result.reason)  # the numbers before it mean nothing
    for name, one in result.extremes.items():
        unit = f"[{result.units[name]}]"
        said = {f"min({name}) {unit}": one.least, f"t_min({name}) [s]": one.t_least}
        said |= {f"max({name}) {unit}": one.greatest, f"t_max({name}) [s]": one.t_greatest}
        said[f"final({name}) {unit}"] = float(result[name][-1])
        row |= dict.fromkeys(said) if blown else said
    row["expectations"] = all(claim.ok for claim in result.expectations) if result.expectations else None
    return row | {"steps": result.summary["steps"], "seconds": result.summary["seconds"]}
