"""The page: one HTML file that asks nothing of any network. Knows what stands where on it; computes nothing."""

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
SHARED = 900  # bins of all sections together
PAPER_TITLE = 100  # letters over each page of paper
WARNINGS = 40  # on the page; all are in summary.json


def page(result, ways: list[SectionWay]) -> str:
    """The report of a run as HTML."""
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
        "told": _cut([one.text for one in result.warnings if one.ok]), "happened": _there([numerics.cavities(result),
                                                                                     numerics.events(result)]),
        "versions": numerics.versions(result),
    }  # fmt: skip
    return rendered("page", filled, figures)


def rendered(name: str, filled: dict[str, Any], figures: dict[str, Any]) -> str:
    """A page filled in, with its style, its script, the charting library and the figures within it."""
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
    """Text as a string of CSS, which nothing within can end."""
    text = text if len(text) <= PAPER_TITLE else f"{text[: PAPER_TITLE - 1]}\u2026"
    return '"' + "".join(one if one.isascii() and one.isalnum() else f"\\{ord(one):x} " for one in text) + '"'


def embedded(data: Any) -> str:
    """JSON that no text within can end or escape: it stands in a <script> of the page. What is no number is null."""
    try:
        text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    except ValueError:  # of a run that stopped on one
        data = json.loads(json.dumps(data), parse_constant=lambda _: None)
        text = json.dumps(data, separators=(",", ":"), ensure_ascii=False)
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


def _sections(result, sections: list[Section], figures: dict[str, Any]) -> list[dict[str, Any]]:
    """What the page says of each section; its figure goes into `figures`."""
    moving = motions(result, [one.way for one in sections])
    height, along = in_units(result, "greatest_head").unit, in_units(result, "distance").unit
    told, bins = [], min(BINS, SHARED // max(len(sections), 1))
    for k, one in enumerate(sections):
        line = moving[k] if moving else None
        figures[f"section-{k}"] = section_figure(one, line, height, along, bins)
        told.append({"id": f"section-{k}", "name": visible(one.way.name),
                     "length": f"{worded(in_units(result, 'distance').from_si(one.way.length))} {along}",
                     "frames": 0 if line is None else len(line.times), "pipes": len(one.way.legs),
                     "parted": bool(one.parted)})  # fmt: skip
    return told


def _histories(result, figures: dict[str, Any]) -> list[dict[str, Any]]:
    """What the page says of each panel of histories; its figure goes into `figures`."""
    drawn = result.history_drawn()
    doubt = min((time for time, _ in drawn.get("marks", ())), default=None)
    told = []
    for k, panel in enumerate(panels(result)):
        figures[f"history-{k}"] = history_figure(panel, drawn["time_unit"], doubt)
        hidden = sum(not line.seen for line in panel.lines)
        told.append({"id": f"history-{k}", "name": panel.quantity.replace("_", " "), "hidden": hidden})
    return told


def _there(tables: list[ReportTable | None]) -> list[ReportTable]:
    return [one for one in tables if one is not None and one.rows]


def _cut(texts: list[str]) -> list[str]:
    more = len(texts) - WARNINGS
    return [visible(one) for one in texts[:WARNINGS]] + ([f"{more} more in summary.json"] if more > 0 else [])
