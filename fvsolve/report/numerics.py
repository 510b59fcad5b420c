"""How the numbers were made and what was kept: scheme, step, ledgers, versions. Knows a summary; knows no solver."""

from __future__ import annotations

from fvsolve.output.column import column
from fvsolve.report.tables import ReportTable, worded

UNITS = {"mass": "kg", "energy": "J"}  # of ledgers; others are in the unit of their scalar
TERMS = ("initial", "inflow", "outflow", "spilled", "made_up", "final")


def settings(result) -> ReportTable:
    """Scheme, method, step and what the run took."""
    said, numerics = result.summary, result.case.numerics
    steps = {"courant": "Courant number", "step": "given, s", "rtol": "by error, rtol"}
    given = [
        f"{words} {worded(getattr(numerics, key))}" for key, words in steps.items() if getattr(numerics, key, None)
    ]
    time = column("", "time", result.case)
    span = [worded(float(time.from_si(one))) for one in (numerics.start, said["t"])]
    rows = [["time", f"{span[0]} to {span[1]} {time.unit}"]]
    if said["cells"]:
        rows += [["scheme", _scheme(numerics)], ["cells", said["cells"]]]
    rows += [["method", "; ".join(_method(one, result.case) for one in said["methods"])],
             ["step", "; ".join(given) or "by default"],
             ["steps", said["steps"]], ["steps taken again", said["rejections"]], ["calls of rates", said["rhs"]],
             ["seconds of stepping", said["seconds"]]]  # fmt: skip
    if "resolution" in said:
        rows.append(
            ["errors of peaks (\u00b1)", "; ".join([said["resolution"]["words"], *said["resolution"]["reasons"]])]
        )
    return ReportTable("Method", ("", ""), [[key, worded(value)] for key, value in rows])


def ledgers(result) -> ReportTable | None:
    """What came in, went out and is stored, and what does not add up."""
    found = {name: one for name, one in result.summary["ledgers"].items() if "remainder" in one}
    if not found:
        return None
    terms = [term for term in TERMS if any(isinstance(one.get(term), float) for one in found.values())]
    rows = [[name, UNITS.get(name, ""), *(one.get(term) for term in terms), f"{one['remainder']:.2e}",
             f"{one['relative']:.1e}" if "relative" in one else None] for name, one in found.items()]  # fmt: skip
    heads = ("ledger", "unit", *(term.replace("_", " ") for term in terms), "remainder", "of the largest term")
    return ReportTable("Ledgers", heads, rows)


def versions(result) -> ReportTable:
    """What made the numbers: versions, the case's hash, when."""
    rows = [["run ended", result.summary.get("ended", "not recorded")]]
    words = {"case": "hash of the case", "sources": "hash of compiled sources", "fluid": "fluid properties",
             "target": "machine"}  # fmt: skip
    rows += [[words.get(key, key), one] for key, one in result.summary["versions"].items()]
    return ReportTable("", ("", ""), rows)


def events(result) -> ReportTable | None:
    """What parts did by themselves."""
    rows = [[one["time"], one["name"], one["what"]] for one in result.summary["events"]]
    return ReportTable("Events", ("time", "part", "what"), rows, ("s",), more="in summary.json") if rows else None


def cavities(result) -> ReportTable | None:
    """Where liquid parted, and how much of it."""
    rows = [[one["place"].removeprefix("links."), one["distance"], one["time"], one["volume"], one["t_volume"]]
            for one in result.summary["cavities"]]  # fmt: skip
    heads = ("pipe", "first at", "time", "greatest volume", "time")
    return ReportTable("Cavities", heads, rows, ("", "m", "s", "m3", "s")) if rows else None


def comparisons(result) -> ReportTable | None:
    """Measured series beside their probes."""
    rows = [[one.probe, one.file, one.unit, one.rms, one.greatest_difference, one.measured_peak, one.computed_peak]
            for one in result.comparisons]  # fmt: skip
    heads = ("probe", "measured", "unit", "rms", "greatest difference", "peak measured", "computed")
    return ReportTable("Against measurements", heads, rows, loose=frozenset({3, 4, 5, 6})) if rows else None


def _scheme(numerics) -> str:
    limiter = getattr(numerics, "limiter", None)
    return f"{numerics.scheme}, limiter {limiter}" if limiter and numerics.scheme == "muscl" else numerics.scheme


def _method(one: dict, case) -> str:
    return one["method"] if not one["time"] else f"{one['method']} from {case.amount(one['time'], 'time', 6)} on"
