"""HTML report of a run: one file with all data, scripts and styles, which needs no network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fvsolve.errors import visible
from fvsolve.report import described, numerics, trust, worst
from fvsolve.report.figures import DARK, history_figure, section_figure
from fvsolve.report.heads import in_units
from fvsolve.report.histories import chosen, panels
from fvsolve.report.legs import SectionWay
from fvsolve.report.libraries import charts, template
from fvsolve.report.motion import motions
from fvsolve.report.section import BINS, Section, section
from fvsolve.report.tables import ReportTable, worded
from fvsolve.run.result import not_valid

HERE = Path(__file__).parent
SHARED = 900  # greatest number of bins of all sections together
PAPER_TITLE = 100  # greatest number of letters of the title on each printed page
WARNINGS = 40  # greatest number on the page; summary.json has all


def page(result, ways: list[SectionWay]) -> str:
    """HTML report of a run."""
    sections = [section(result, way) for way in ways]
    figures: dict[str, Any] = {}
    probes = worst.of_probes(result)
    filled = {
        "invalid": not_valid(result.summary),
        "title": visible(result.summary["title"] or result.summary["case"]), "run": result.summary,
        "description": visible(result.case.description), "source": visible(result.case.source),
        "ended": result.summary.get("ended", ""), "words": trust.words(result),
        "limits": trust.verdicts(result), "worst": worst.of_all(result, ways) or probes,
        "sections": _sections(result, sections, figures), "histories": _histories(result, figures),
        "probes_left_out": len(result.probes) - len(chosen(result)),
        "places": _there([*trust.worst(result), *worst.by_pipe(result), probes if result.envelope else None]),
        "model": _there(described.model(result)),
        "numbers": _there([numerics.settings(result), numerics.ledgers(result), trust.claims(result),
                           numerics.comparisons(result)]),
        "told": _cut([notice.text for notice in result.warnings if notice.ok]),
        "happened": _there([numerics.cavities(result), numerics.events(result)]),
        "versions": numerics.versions(result),
    }  # fmt: skip
    return rendered("page", filled, figures)


def rendered(name: str, filled: dict[str, Any], figures: dict[str, Any]) -> str:
    """Render a template with its data, style, script, figures and the charting library embedded.

    name : "page" or "study"; filled : values of the template; figures : id -> data for plotly.js
    """
    files = {"table": "table.html.j2", "page": f"{name}.html.j2", "css": "page.css", "js": "page.js"}
    texts = {key: (HERE / file).read_text(encoding="utf-8") for key, file in files.items()}
    return template(texts["table"] + texts["page"]).render(
        filled,
        css=texts["css"],
        script=texts["js"],
        library=charts(),
        figures=embedded(figures),
        dark=json.dumps(DARK),
        paper=quoted(filled["title"]),
    )


def quoted(text: str) -> str:
    """Text as a CSS string; all but ASCII letters and digits are escaped, so that nothing can end it early."""
    text = text if len(text) <= PAPER_TITLE else f"{text[: PAPER_TITLE - 1]}\u2026"
    return (
        '"'
        + "".join(letter if letter.isascii() and letter.isalnum() else f"\\{ord(letter):x} " for letter in text)
        + '"'
    )


def embedded(data: Any) -> str:
    """JSON for a <script> element of the page, escaped so that no text can end it; NaN and infinity become null."""
    try:
        text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    except ValueError:  # a run that stopped at a value that is not finite
        data = json.loads(json.dumps(data), parse_constant=lambda _: None)
        text = json.dumps(data, separators=(",", ":"), ensure_ascii=False)
    for letter in "<>&\u2028\u2029":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return text


def _sections(result, sections: list[Section], figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Template data of each section; adds its figure to `figures`."""
    moving = motions(result, [item.way for item in sections])
    height, along = in_units(result, "max_head").unit, in_units(result, "distance").unit
    entries, bins = [], min(BINS, SHARED // max(len(sections), 1))
    for k, item in enumerate(sections):
        line = moving[k] if moving else None
        figures[f"section-{k}"] = section_figure(item, line, height, along, bins)
        entries.append({"id": f"section-{k}", "name": visible(item.way.name),
                     "length": f"{worded(in_units(result, 'distance').from_si(item.way.length))} {along}",
                     "frames": 0 if line is None else len(line.times), "pipes": len(item.way.legs),
                     "parted": bool(item.parted)})  # fmt: skip
    return entries


def _histories(result, figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Template data of each panel of histories; adds its figure to `figures`."""
    drawn = result.history_drawn()
    doubt = min((time for time, _ in drawn.get("marks", ())), default=None)
    entries = []
    for k, panel in enumerate(panels(result)):
        figures[f"history-{k}"] = history_figure(panel, drawn["time_unit"], doubt)
        hidden = sum(not line.seen for line in panel.lines)
        entries.append({"id": f"history-{k}", "name": panel.quantity.replace("_", " "), "hidden": hidden})
    return entries


def _there(tables: list[ReportTable | None]) -> list[ReportTable]:
    return [table for table in tables if table is not None and table.rows]


def _cut(texts: list[str]) -> list[str]:
    more = len(texts) - WARNINGS
    return [visible(text) for text in texts[:WARNINGS]] + ([f"{more} more in summary.json"] if more > 0 else [])
