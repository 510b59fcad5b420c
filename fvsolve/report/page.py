"""HTML report of a run: one file with all data, scripts and styles, which needs no network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fvsolve.errors import visible
from fvsolve.report import model_tables, numerics, reliability, worst_places
from fvsolve.report.envelope_units import envelope_column
from fvsolve.report.figures import DARK_COLOURS, history_figure, section_figure
from fvsolve.report.head_animation import head_animations
from fvsolve.report.histories import chosen_probes, history_panels
from fvsolve.report.libraries import plotly_source, template
from fvsolve.report.long_section import MAX_BINS, Section, section_of
from fvsolve.report.section_pipes import SectionPath
from fvsolve.report.tables import ReportTable, value_text
from fvsolve.run.result import not_valid

TEMPLATE_FOLDER = Path(__file__).parent
MAX_SHARED_BINS = 900  # greatest number of bins of all sections together
MAX_PAPER_TITLE = 100  # greatest number of letters of the title on each printed page
MAX_WARNINGS = 40  # greatest number on the page; summary.json has all


def page(result, ways: list[SectionPath]) -> str:
    """HTML text of the report of a run; ways : paths of its long sections."""
    sections = [section_of(result, way) for way in ways]
    figures: dict[str, Any] = {}
    probes = worst_places.extremes_of_probes(result)
    filled = {
        "invalid": not_valid(result.summary),
        "title": visible(result.summary["title"] or result.summary["case"]),
        "run": result.summary,
        "description": visible(result.case.description),
        "source": visible(result.case.source),
        "ended": result.summary.get("ended", ""),
        "words": reliability.top_sentences(result),
        "limits": reliability.verdict_table(result),
        "worst": worst_places.extremes_of_pipes(result, ways) or probes,
        "sections": _sections(result, sections, figures),
        "histories": _histories(result, figures),
        "probes_left_out": len(result.probes) - len(chosen_probes(result)),
        "places": _nonempty(
            [*reliability.worst_tables(result), *worst_places.ranked_pipes(result), probes if result.envelope else None]
        ),
        "model": _nonempty(model_tables.all_tables(result)),
        "numbers": _nonempty(
            [
                numerics.settings(result),
                numerics.ledgers(result),
                reliability.claim_table(result),
                numerics.comparisons(result),
            ]
        ),
        "told": _warning_texts([notice.text for notice in result.warnings if notice.ok]),
        "happened": _nonempty([numerics.cavities(result), numerics.events(result)]),
        "versions": numerics.versions(result),
    }
    return render_page("page", filled, figures)


def render_page(name: str, filled: dict[str, Any], figures: dict[str, Any]) -> str:
    """Render a template with its data, style, script, figures and the charting library embedded.

    name : "page" or "study"; filled : values of the template; figures : id -> data for plotly.js
    """
    files = {"table": "table.html.j2", "page": f"{name}.html.j2", "css": "page.css", "js": "page.js"}
    texts = {key: (TEMPLATE_FOLDER / file).read_text(encoding="utf-8") for key, file in files.items()}
    return template(texts["table"] + texts["page"]).render(
        filled,
        css=texts["css"],
        script=texts["js"],
        library=plotly_source(),
        figures=script_json(figures),
        dark=json.dumps(DARK_COLOURS),
        paper=css_string(filled["title"]),
    )


def css_string(text: str) -> str:
    """CSS string of a text; all but ASCII letters and digits are escaped, so that the text cannot end the string."""
    text = text if len(text) <= MAX_PAPER_TITLE else f"{text[: MAX_PAPER_TITLE - 1]}\u2026"
    return (
        '"'
        + "".join(letter if letter.isascii() and letter.isalnum() else f"\\{ord(letter):x} " for letter in text)
        + '"'
    )


def script_json(data: Any) -> str:
    """JSON text for a <script> element of the page; no text in it can end the element. NaN and infinity become null."""
    try:
        text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    except ValueError:  # a run that stopped at a value that is not finite
        data = json.loads(json.dumps(data), parse_constant=lambda _: None)
        text = json.dumps(data, separators=(",", ":"), ensure_ascii=False)
    for letter in "<>&\u2028\u2029":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return text


def _sections(result, sections: list[Section], figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Values for the template on each section, such as name and length; its figure is added to `figures`."""
    moving = head_animations(result, [item.way for item in sections])
    height, along = envelope_column(result, "max_head").unit, envelope_column(result, "distance").unit
    entries, bins = [], min(MAX_BINS, MAX_SHARED_BINS // max(len(sections), 1))
    for k, item in enumerate(sections):
        line = moving[k] if moving else None
        figures[f"section-{k}"] = section_figure(item, line, height, along, bins)
        entries.append({"id": f"section-{k}", "name": visible(item.way.name),
                     "length": f"{value_text(envelope_column(result, 'distance').from_si(item.way.length))} {along}",
                     "frames": 0 if line is None else len(line.times), "pipes": len(item.way.legs),
                     "parted": bool(item.cavity_spans)})  # fmt: skip
    return entries


def _histories(result, figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Values for the template on each panel of histories; its figure is added to `figures`."""
    drawn = result.history_drawn()
    doubt = min((time for time, _ in drawn.get("marks", ())), default=None)
    entries = []
    for k, panel in enumerate(history_panels(result)):
        figures[f"history-{k}"] = history_figure(panel, drawn["time_unit"], doubt)
        hidden = sum(not line.seen for line in panel.lines)
        entries.append({"id": f"history-{k}", "name": panel.quantity.replace("_", " "), "hidden": hidden})
    return entries


def _nonempty(tables: list[ReportTable | None]) -> list[ReportTable]:
    return [table for table in tables if table is not None and table.rows]


def _warning_texts(texts: list[str]) -> list[str]:
    more = len(texts) - MAX_WARNINGS
    return [visible(text) for text in texts[:MAX_WARNINGS]] + ([f"{more} more in summary.json"] if more > 0 else [])
