"""Report tables of numerics: scheme, method, step, ledgers, events, cavities, comparisons and versions."""

from __future__ import annotations

from fvsolve.output.unit_columns import column
from fvsolve.report.tables import ReportTable, value_text

LEDGER_UNITS = {"mass": "kg", "energy": "J"}  # units of ledgers; ledgers of scalars, in kg times their unit, show none
LEDGER_TERMS = ("initial", "inflow", "outflow", "spilled", "made_up", "final")


def settings(result) -> ReportTable:
    """Table of scheme, method, time step, number of steps, and computing time of a run."""
    summary, numerics = result.summary, result.case.numerics
    steps = {"courant": "Courant number", "step": "given, s", "rtol": "by error, rtol"}
    given = [
        f"{words} {value_text(getattr(numerics, key))}" for key, words in steps.items() if getattr(numerics, key, None)
    ]
    time = column("", "time", result.case)
    span = [value_text(float(time.from_si(item))) for item in (numerics.start, summary["t"])]
    rows = [["time", f"{span[0]} to {span[1]} {time.unit}"]]
    if summary["cells"]:
        rows += [["scheme", _scheme_text(numerics)], ["cells", summary["cells"]]]
    rows += [["method", "; ".join(_method_text(item, result.case) for item in summary["methods"])],
             ["step", "; ".join(given) or "by default"],
             ["steps", summary["steps"]], ["repeated steps", summary["rejections"]],
             ["evaluations of rates", summary["rhs"]], ["computing time [s]", summary["seconds"]]]  # fmt: skip
    if "resolution" in summary:
        rows.append(
            ["errors of peaks (\u00b1)", "; ".join([summary["resolution"]["words"], *summary["resolution"]["reasons"]])]
        )
    return ReportTable("Method", ("", ""), [[key, value_text(value)] for key, value in rows])


def ledgers(result) -> ReportTable | None:
    """Table of the balances of mass, energy and scalars: inflow, outflow, storage, remainder; None without balances."""
    balances = {name: row for name, row in result.summary["ledgers"].items() if "remainder" in row}
    if not balances:
        return None
    terms = [term for term in LEDGER_TERMS if any(isinstance(row.get(term), float) for row in balances.values())]
    rows = [[name, LEDGER_UNITS.get(name, ""), *(row.get(term) for term in terms), f"{row['remainder']:.2e}",
             f"{row['relative']:.1e}" if "relative" in row else None] for name, row in balances.items()]  # fmt: skip
    heads = ("ledger", "unit", *(term.replace("_", " ") for term in terms), "remainder", "of the largest term")
    return ReportTable("Ledgers", heads, rows)


def versions(result) -> ReportTable:
    """Table of versions of programs and data, hash of the case, and date of the run."""
    rows = [["run ended", result.summary.get("ended", "not recorded")]]
    words = {"case": "hash of the case", "sources": "hash of compiled sources", "fluid": "fluid properties",
             "target": "machine"}  # fmt: skip
    rows += [[words.get(key, key), version] for key, version in result.summary["versions"].items()]
    return ReportTable("", ("", ""), rows)


def events(result) -> ReportTable | None:
    """Table of events of self-acting parts with their times; None without events."""
    rows = [[event["time"], event["name"], event["what"]] for event in result.summary["events"]]
    return ReportTable("Events", ("time", "part", "event"), rows, ("s",), more="in summary.json") if rows else None


def cavities(result) -> ReportTable | None:
    """Table of cavities in pipes: first position and time, greatest volume and its time; None without cavities."""
    rows = [[row["place"].removeprefix("links."), row["distance"], row["time"], row["volume"], row["t_volume"]]
            for row in result.summary["cavities"]]  # fmt: skip
    heads = ("pipe", "first at", "time", "greatest volume", "time")
    return ReportTable("Cavities", heads, rows, ("", "m", "s", "m3", "s")) if rows else None


def comparisons(result) -> ReportTable | None:
    """Table that compares probes with measured series; None without measurements."""
    rows = [[row.probe, row.file, row.unit, row.rms, row.greatest_difference, row.measured_peak, row.computed_peak]
            for row in result.comparisons]  # fmt: skip
    heads = ("probe", "measured", "unit", "rms", "greatest difference", "peak measured", "computed")
    return ReportTable("Against measurements", heads, rows, mixed_units=frozenset({3, 4, 5, 6})) if rows else None


def _scheme_text(numerics) -> str:
    limiter = getattr(numerics, "limiter", None)
    return f"{numerics.scheme}, limiter {limiter}" if limiter and numerics.scheme == "muscl" else numerics.scheme


def _method_text(row: dict, case) -> str:
    return row["method"] if not row["time"] else f"{row['method']} from {case.amount(row['time'], 'time', 6)} on"
