"""Sentences and tables of the report of a run: verdicts, extremes, method, ledgers, events, versions."""

from typing import NamedTuple

import numpy as np

from fvsolve.output.unit_columns import UnitColumn, column
from fvsolve.report.long_section import envelope_column
from fvsolve.report.section_pipes import SectionPath
from fvsolve.report.tables import ERROR_HEADER, ReportTable, in_unit, value_text
from fvsolve.run.result import FAILS, HOLDS, IN_WORDS, OPEN, not_valid
from fvsolve.units import span

BOUND_WORDS = {"minimum": "at\u00a0least", "maximum": "at\u00a0most"}
MAX_LATER_MARKS = 6  # greatest number of marks named after the first
MAX_RANKED = 10  # greatest number of rows of a ranking on the page
EXTREMES = (  # quantity, its text, function of the index of the extreme, quantity of its time
    ("max_pressure", "maximum pressure", np.argmax, "t_max"),
    ("min_pressure", "minimum pressure", np.argmin, "t_min"),
    ("max_head", "maximum head", np.argmax, "t_max"),
    ("min_head", "minimum head", np.argmin, "t_min"),
)
LEDGER_UNITS = {"mass": "kg", "energy": "J"}  # units of ledgers; ledgers of scalars, in kg times their unit, show none
LEDGER_TERMS = ("initial", "inflow", "outflow", "spilled", "made_up", "final")


class Sentence(NamedTuple):
    """Sentence at the top of a report.

    level : "bad", "doubt", "good" or "none"; head : first words, in bold; links : (name, address) of pages
    """

    level: str
    head: str
    text: str
    links: tuple[tuple[str, str], ...] = ()


def top_sentences(result) -> list[Sentence]:
    """Sentences at the top of a report: early stop, errors, doubts, verdict on limits, failed or open expectations."""
    summary = result.summary
    rows = []
    if result.reason != "finished":
        reached, end = (result.case.amount(item, "time", 6) for item in (summary["t"], result.case.numerics.end))
        text = f"{result.reason}. The run reached t = {reached} of {end}; later values are unknown."
        rows.append(Sentence("bad", "This run stopped early.", text))
    rows += [Sentence("bad", "Not to be trusted.", item.text) for item in result.warnings if not item.ok]
    rows += [*_mark_sentences(result), verdict_sentence(result)]
    for state, level, head in ((FAILS, "bad", "The run does not meet an expected value of the case."),
                               (OPEN, "doubt", "The verdict of an expected value is open.")):  # fmt: skip
        if claims := [item for item in result.expectations if item.state == state]:
            more = f"; and {len(claims) - 1} more, under Numerics" if len(claims) > 1 else ""
            rows.append(Sentence(level, head, claim_text(claims[0]) + more))
    return rows


def _mark_sentences(result) -> list[Sentence]:
    """List of one sentence on the time from which results are not valid, the first mark and the places of later marks.

    It is empty without marks.
    """
    marks = sorted(result.marks, key=lambda mark: mark.time)
    if not marks:
        return []
    when = [result.case.amount(mark.time, "time", 6) for mark in marks]
    places = [f"{mark.place.partition('.')[2]} at {t}" for mark, t in zip(marks, when, strict=True)]
    later = ", ".join(places[1 : 1 + MAX_LATER_MARKS])
    more = f", and {len(marks) - 1 - MAX_LATER_MARKS} more places" if len(marks) > 1 + MAX_LATER_MARKS else ""
    text = marks[0].text + (f". Later also {later}{more}" if later else "")
    return [Sentence("doubt", f"Results from {when[0]} on are not to be trusted.", text)]


def verdict_sentence(result) -> Sentence:
    """Sentence on the limits of the case: some are violated, some are open, all hold, or none is stated."""
    verdicts = result.verdicts
    if not verdicts:
        text = "The case has no [limits], so this report shows what happens, but not whether this is allowed."
        return Sentence("none", "No limits were stated.", text)
    states = [item.state for item in verdicts]
    failed = [item.name for item, state in zip(verdicts, states, strict=True) if state == FAILS]
    if failed:
        text = f"{len(failed)} of {len(verdicts)} limits" if len(verdicts) > 1 else "The limit"
        return Sentence("bad", f"{text} {'do' if len(failed) > 1 else 'does'} not hold.", ", ".join(failed))
    unsure = [item.name for item, state in zip(verdicts, states, strict=True) if state == OPEN]
    if unsure:
        return Sentence("doubt", f"The verdict of {'limits' if len(unsure) > 1 else 'a limit'} is open.",
                    f"{', '.join(unsure)}: {open_reason(result)}.")  # fmt: skip
    summary = f"All {len(verdicts)} limits hold" if len(verdicts) > 1 else "The limit holds"
    if result.reason == "finished" and result.ok and not result.marks:
        return Sentence("good", f"{summary}.", "")
    return Sentence("doubt", f"{summary}, as far as results are reliable.", "")


def open_reason(result) -> str:
    """Reason for which the limits of a run are open (undecided), as a part of a sentence."""
    if text := not_valid(result.summary):
        return f"the run is {text}"
    if not result.ok:
        return "the run stopped early or its numbers are wrong"
    if result.marks:
        return "from some time on the results are not to be trusted"
    if any(notice.kind == "end" for notice in result.warnings):
        return "a schedule continues, or a trip occurs, after the end of the run"
    return "margins are smaller than the numerical errors"


def verdict_table(result) -> ReportTable:
    """Table of the verdicts on limits, violated limits first."""
    order = (FAILS, OPEN, HOLDS)
    ordered = sorted(result.verdicts, key=lambda check: order.index(check.state))
    length, height, time = (column("", dimension, result.case) for dimension in ("length", "head", "time"))
    errors = any(check.error is not None for check in ordered)
    rows = []
    for check in ordered:
        limit = f"{value_text(check.limit)} {check.unit}"
        requirement = f"{check.quantity.replace('_', ' ')} {BOUND_WORDS[check.bound]} {limit}"
        margin_unit = span(check.unit)
        unit_text = check.unit if margin_unit == check.unit else f"{check.unit}, margin {margin_unit}"
        place = in_unit(length, check.chainage), in_unit(height, check.elevation), in_unit(time, check.time)
        margin = not_valid(result.summary) or None if check.margin is None else check.margin
        rows.append([check.name, requirement, IN_WORDS[check.state], check.value, *[check.error] * errors, margin,
                     unit_text, check.place, *place])  # fmt: skip
    heads = ("limit", "requirement", "verdict", "value", *[ERROR_HEADER] * errors, "margin", "unit", "worst place")
    heads += ("chainage", "elevation", "time")
    bad = frozenset(k for k, check in enumerate(ordered) if check.state == FAILS)
    units = ("",) * (7 + errors) + (length.unit, height.unit, time.unit)
    return ReportTable("Limits", heads, rows, units, bad, frozenset({3, 4, *[5] * errors}))


def worst_tables(result) -> list[ReportTable]:
    """Tables of the positions with the least margins, for each limit with more than one part or bound."""
    length, height, time = (column("", dimension, result.case) for dimension in ("length", "head", "time"))
    tables = []
    for check in result.verdicts:
        keys = ((length, "chainage"), (height, "elevation"), (time, "time"))
        errors = any(row["error"] is not None for row in check.worst)
        rows = [[row["place"], *(in_unit(shown, row[key]) for shown, key in keys), row["value"],
                 *[row["error"]] * errors, BOUND_WORDS[row["bound"]], row["limit"], row["margin"],
                 IN_WORDS[row["state"]]] for row in check.worst]  # fmt: skip
        bad = frozenset(k for k, row in enumerate(check.worst) if row["state"] == FAILS)
        margin_unit = span(check.unit)
        units = ("", length.unit, height.unit, time.unit, check.unit, *[margin_unit] * errors, "", check.unit,
                 margin_unit, "")  # fmt: skip
        heads = ("place", "chainage", "elevation", "time", check.quantity.replace("_", " "), *[ERROR_HEADER] * errors)
        heads += ("", "limit", "margin", "verdict")
        tables += [ReportTable(f"Limit {check.name}: worst places", heads, rows, units, bad)] if len(rows) > 1 else []
    return tables


def claim_table(result) -> ReportTable:
    """Table of the expected values of the case and of the computed values."""
    rows = [[item.text, item.claimed, item.found, item.tolerance, item.unit, IN_WORDS[item.state]]
            for item in result.expectations]  # fmt: skip
    bad = frozenset(k for k, item in enumerate(result.expectations) if item.state == FAILS)
    heads = ("expectation", "expected", "computed", "tolerance", "unit", "verdict")
    return ReportTable("Expected values of the case", heads, rows, bad=bad, mixed_units=frozenset({1, 2, 3}))


def claim_text(item) -> str:
    """Text that compares an expected value of the case with the computed value."""
    return f"{item.text}: expected {item.claimed:.6g}, computed {value_text(item.found)} {item.unit}"


def extremes_of_pipes(result, ways: list[SectionPath]) -> ReportTable | None:
    """Table of the extremes of each quantity over all pipes: value, pipe, distance, elevation, time.

    It is None without pipes, or if the run diverged. The chainage is added if the run has a single section, and if the
    chainage differs from the distance along the pipe. ways : paths of the long sections
    """
    envelope = result.envelope
    if not envelope or not_valid(result.summary):
        return None
    legs = {leg.pipe: leg for way in ways for leg in way.legs}
    if len(ways) > 1 or all(leg.begin == 0.0 and not leg.backwards for leg in legs.values()):
        legs = {}  # the chainage equals the distance, or the section would be ambiguous
    rows, along = [], envelope_column(result, "distance")
    for name, words, most, when in EXTREMES:
        ends = {pipe: int(most(arrays[name])) for pipe, arrays in envelope.items()}
        pipes = list(ends)
        pipe = pipes[int(most([envelope[key][name][ends[key]] for key in pipes]))]
        arrays, k = envelope[pipe], ends[pipe]
        value, distance, height, time = (float(arrays[key][k]) for key in (name, "distance", "elevation", when))
        leg = legs.get(pipe)
        chainage = None if leg is None else float(along.from_si(leg.chainage(along.to_si(arrays["distance"][k]))))
        rows.append([words, value, envelope_column(result, name).unit, pipe, distance, *[chainage] * bool(legs),
                     height, time])  # fmt: skip
    keys = ("distance", *["distance"] * bool(legs), "elevation", "t_max")
    units = [envelope_column(result, key).unit for key in keys]
    heads = ("", "value", "unit", "pipe", "from its start", *["chainage"] * bool(legs), "elevation", "time")
    return ReportTable("Worst of all pipes", heads, rows, ("",) * 4 + tuple(units), mixed_units=frozenset({1}))


def ranked_pipes(result) -> list[ReportTable]:
    """Tables of pipes ranked by greatest and by least pressure, worst first; [] for a single pipe or a diverged run."""
    if len(result.envelope) < 2 or not_valid(result.summary):
        return []
    return [_ranking(result, name, words, most, when) for name, words, most, when in EXTREMES[:2]]


def _ranking(result, name: str, words: str, most, when: str) -> ReportTable:
    rows = []
    for pipe, arrays in result.envelope.items():
        k = int(most(arrays[name]))
        rows.append([pipe, *(float(arrays[key][k]) for key in (name, "distance", "elevation", when))])
    rows.sort(key=lambda row: row[1], reverse=most is np.argmax)
    units = ["", *(envelope_column(result, key).unit for key in (name, "distance", "elevation", when))]
    heads = ("pipe", words, "from its start", "elevation", "time")
    return ReportTable(f"{words.capitalize()} by pipe", heads, rows, units, most=MAX_RANKED,
                 more="in envelope.csv and in the workbook (--xlsx)")  # fmt: skip


def extremes_of_probes(result) -> ReportTable:
    """Table of the extremes of each probe over all accepted steps, with times and errors."""
    peaks, rows, invalid = result.summary.get("peaks", {}), [], not_valid(result.summary) or None
    clock = UnitColumn("t", "time", result.summary["time_unit"])
    for name, extremes in result.extremes.items():
        errors = {side: [peaks[name][side]["error"]] if peaks else [] for side in ("minimum", "maximum")}
        first, last = (in_unit(clock, t) for t in (extremes.t_min, extremes.t_max))
        low, high = (invalid if value is None else value for value in (extremes.minimum, extremes.maximum))
        rows.append([name, result.units[name], low, *errors["minimum"], first, high, *errors["maximum"], last])
    heads = [column for side in ("minimum", "maximum") for column in (side, *[ERROR_HEADER] * bool(peaks), "time")]
    units = [clock.unit if column == "time" else "" for column in heads]
    loose = frozenset(2 + k for k, column in enumerate(heads) if column != "time")
    return ReportTable("Probes", ("probe", "unit", *heads), rows, ("", "", *units), mixed_units=loose,
                 more="in summary.json and in the workbook (--xlsx)")  # fmt: skip


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


def events(result) -> ReportTable:
    """Table of events of self-acting parts with their times."""
    rows = [[event["time"], event["name"], event["what"]] for event in result.summary["events"]]
    return ReportTable("Events", ("time", "part", "event"), rows, ("s",), more="in summary.json")


def cavities(result) -> ReportTable:
    """Table of cavities in pipes: first position and time, greatest volume and its time."""
    rows = [[row["place"].removeprefix("links."), row["distance"], row["time"], row["volume"], row["t_volume"]]
            for row in result.summary["cavities"]]  # fmt: skip
    heads = ("pipe", "first at", "time", "greatest volume", "time")
    return ReportTable("Cavities", heads, rows, ("", "m", "s", "m3", "s"))


def comparisons(result) -> ReportTable:
    """Table that compares probes with measured series."""
    rows = [[row.probe, row.file, row.unit, row.rms, row.greatest_difference, row.measured_peak, row.computed_peak]
            for row in result.comparisons]  # fmt: skip
    heads = ("probe", "measured", "unit", "rms", "greatest difference", "peak measured", "computed")
    return ReportTable("Against measurements", heads, rows, mixed_units=frozenset({3, 4, 5, 6}))


def _scheme_text(numerics) -> str:
    limiter = getattr(numerics, "limiter", None)
    return f"{numerics.scheme}, limiter {limiter}" if limiter and numerics.scheme == "muscl" else numerics.scheme


def _method_text(row: dict, case) -> str:
    return row["method"] if not row["time"] else f"{row['method']} from {case.amount(row['time'], 'time', 6)} on"
