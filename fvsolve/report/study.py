"""The page of a study: which protection holds in which event, and the runs laid over one another. Runs nothing."""

from __future__ import annotations

from typing import Any

from fvsolve.case.text import inline
from fvsolve.draw.plot import quantity, thinned
from fvsolve.errors import visible
from fvsolve.output.column import column
from fvsolve.report import described, numerics
from fvsolve.report.figures import history_figure, study_section
from fvsolve.report.heads import in_units
from fvsolve.report.histories import HistoryPanel, Series
from fvsolve.report.legs import ways
from fvsolve.report.page import WARNINGS, rendered
from fvsolve.report.section import section
from fvsolve.report.tables import ERROR, ReportTable, in_unit
from fvsolve.report.trust import Word, open_for
from fvsolve.run.result import FAILS, HOLDS, IN_WORDS, OPEN, not_valid
from fvsolve.units import span

POINTS = 400  # of a series
PROBES, SECTIONS = 6, 2  # of an event at most, those of the first run
FAILED = 200  # rows of what fails
CAPTION = "Greatest (full) and least (dashed) head over every accepted step, by protection."


def study_page(said: dict[str, Any], runs: list[tuple[dict[str, Any], Any]]) -> str:
    """The report of a study; said : as study.json has it, runs : (row, `Result`) of each, row["page"] its report."""
    figures: dict[str, Any] = {}
    first = runs[0][1]
    events = [{"id": f"event-{k}", "name": visible(name or "All runs"), "figures": drawn(name, k, runs, figures)}
              for k, name in enumerate(dict.fromkeys(row["event"] for row, _ in runs))]  # fmt: skip
    filled = {
        "title": visible(said["title"] or said["study"]), "said": said, "case": visible(first.summary["case"]),
        "ended": max(result.summary.get("ended", "") for _, result in runs),
        "version": first.summary["versions"]["fvsolve"], "description": visible(first.case.description),
        "words": words(said, runs), "matrix": [matrix(runs)], "events": events,
        "failing": failing(runs), "changes": changed(said), "first": name_of(runs[0][0]),
        "model": [one for one in described.model(first) if one],
        "told": told(runs), "versions": numerics.versions(first),
    }  # fmt: skip
    return rendered("study", filled, figures)


def name_of(row: dict[str, Any]) -> str:
    """`trip with vessel`."""
    return visible(" with ".join(name for name in (row["event"], row["protection"]) if name) or "the case")


def words(said: dict[str, Any], runs: list) -> list[Word]:
    """The sentences at the top: runs that stopped, then which protection holds."""
    found = [Word("bad", f"{name_of(row)} stopped early.", f"{result.reason}.")
             for row, result in runs if result.reason != "finished"]  # fmt: skip
    found += [Word("bad", f"{name_of(row)} is not to be trusted.", one.text)
              for row, result in runs for one in result.warnings if not one.ok]  # fmt: skip
    if doubted := [one for one in runs if one[1].marks]:
        marks = [mark for _, result in doubted for mark in result.marks]
        why = {mark.what: mark.text.partition(": ")[2].partition(";")[0] for mark in marks}
        found.append(Word("doubt", "In part not to be trusted:", f"{'; '.join(why.values())}.", links(doubted)))
    if not any(result.verdicts for _, result in runs):
        return [
            *found,
            Word("none", "No limits were stated.", "The study says what happens, not whether it is allowed."),
        ]
    names = [visible(name) or "the case as it is" for name in said["holds"]]
    if names:
        found.append(Word("good", f"All limits hold in all events with {', '.join(names)}.", ""))
    else:
        found.append(Word("bad", "No protection holds all limits in all events.", ""))
    if failed := [one for one in runs if state_of(one[1]) == FAILS]:
        found.append(Word("bad", "Fails:", "", links(failed)))
    if unsure := [one for one in runs if state_of(one[1]) == OPEN]:
        why = dict.fromkeys(open_for(result) for _, result in unsure)
        found.append(Word("doubt", "Open:", f"{'; '.join(why)}.", links(unsure)))
    return found


def state_of(result) -> str:
    """The worst that becomes of the limits of a run; a run that is not ok fails. "" where nothing was asked."""
    states = [FAILS] * (not result.ok) + [one.state for one in result.verdicts]
    return next((one for one in (FAILS, OPEN, HOLDS) if one in states), "")


def links(runs: list) -> tuple[tuple[str, str], ...]:
    """The reports of runs, by their names."""
    return tuple((name_of(row), row["page"]) for row, _ in runs)


def matrix(runs: list) -> ReportTable:
    """A row a run, which leads to its report: verdict, and the margin of every limit."""
    names = {one.name: one.unit for _, result in runs for one in result.verdicts}
    asked = any(one.error is not None for _, result in runs for one in result.verdicts)
    rows = []
    for row, result in runs:
        found = {one.name: one for one in result.verdicts}
        none = not_valid(result.summary) or None
        margins = [none if key == "margin" and value is None and name in found else value
                   for name in names for key in ("margin", *["error"] * asked)
                   for value in [getattr(found.get(name), key, None)]]  # fmt: skip
        rows.append([name_of(row), IN_WORDS.get(state_of(result), ""), *margins])
    heads = ["run", "verdict"]
    heads += [word for name in names for word in (f"margin of {name}", *[ERROR] * asked)]
    units = ["", ""] + [span(unit) for unit in names.values() for _ in range(1 + asked)]
    bad = frozenset(k for k, (_, result) in enumerate(runs) if state_of(result) == FAILS)
    return ReportTable("Runs", heads, rows, units, bad, links=[row["page"] for row, _ in runs])


def failing(runs: list) -> ReportTable | None:
    """Every limit that fails or is open, where and when."""
    length, time = (column("", what, runs[0][1].case) for what in ("length", "time"))
    where = [row["page"] for row, result in runs for one in result.verdicts if not one.ok]
    rows = [[name_of(row), one.name, IN_WORDS[one.state], one.value, one.limit, one.unit, one.margin, span(one.unit),
             one.place, in_unit(length, one.chainage), in_unit(time, one.time)]
            for row, result in runs for one in result.verdicts if not one.ok]  # fmt: skip
    heads = ("run", "limit", "verdict", "value", "allowed", "unit", "margin", "unit", "worst at", "chainage", "time")
    units = ("",) * 9 + (length.unit, time.unit)
    return ReportTable("", heads, rows, units, loose=frozenset({3, 4, 6}), most=FAILED, links=where) if rows else None


def changed(said: dict[str, Any]) -> list[ReportTable]:
    """What events and protections set, as TOML."""
    made = []
    for group in ("events", "protections"):
        rows = [
            [name, key, inline(value)] for name, keys in said["changes"][group].items() for key, value in keys.items()
        ]
        made += [ReportTable(group.capitalize(), (group[:-1], "key", "is"), rows)] if rows else []
    return made


def drawn(event: str | None, number: int, runs: list, figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Figures of an event, the runs of all protections in each."""
    own = [(row["protection"] or "", result) for row, result in runs if row["event"] == event]
    found = [(name, result, ways(result)) for name, result in own]
    made = []
    for k, way in enumerate(next((some for *_, some in found if some), [])[:SECTIONS]):
        several = [(name, section(result, one)) for name, result, some in found for one in some if one.name == way.name]
        height, along = in_units(own[0][1], "greatest_head").unit, in_units(own[0][1], "distance").unit
        figures[f"section-{number}-{k}"] = study_section(several, height, along)
        made.append({"id": f"section-{number}-{k}", "name": visible(way.name), "caption": CAPTION})
    shared = [name for name in own[0][1].probes if all(name in result.units for _, result in own)]
    for k, probe in enumerate(shared[:PROBES]):
        lines = [
            Series(name or "the case", *thinned(result.t, result[probe], POINTS), seen=True) for name, result in own
        ]
        panel = HistoryPanel(quantity(probe), own[0][1].units[probe], lines)
        figures[f"history-{number}-{k}"] = history_figure(panel, own[0][1].summary["time_unit"], None)
        made.append({"id": f"history-{number}-{k}", "name": visible(probe), "caption": ""})
    return made


def told(runs: list) -> list[str]:
    """Warnings of all runs, those of several once."""
    by_text: dict[str, list[str]] = {}
    for row, result in runs:
        for one in result.warnings:
            by_text.setdefault(one.text, []).append(name_of(row))
    found = [
        f"{text} ({', '.join(names) if len(names) < len(runs) else 'all runs'})" for text, names in by_text.items()
    ]
    return [visible(one) for one in found[:WARNINGS]]
