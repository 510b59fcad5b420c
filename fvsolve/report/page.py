"""HTML reports of runs and studies: files with all data, scripts and styles, which need no network.

In functions for a study, `study` is the data of study.json, and `runs` is a list of (row of study.json, `Result`) for
each run; row["page"] is the address of the report of the run.
"""

import json
from pathlib import Path
from typing import Any

from fvsolve.case.text import inline
from fvsolve.core.output.result_table import ResultTable
from fvsolve.core.output.summary_shape import FAILS, HOLDS, IN_WORDS, OPEN
from fvsolve.core.output.unit_columns import column
from fvsolve.core.run.result import not_valid
from fvsolve.errors import visible
from fvsolve.report import figures as plots
from fvsolve.report import import_library, tables
from fvsolve.report.dated_tables import all_with_dates, with_dates
from fvsolve.report.draw.plot import probe_quantity, thin_series
from fvsolve.report.grouped_notices import grouped_texts
from fvsolve.report.long_section import (
    MAX_BINS,
    Section,
    SectionPath,
    envelope_column,
    head_animations,
    section_of,
    section_paths,
)
from fvsolve.report.maps.flood_map import basins_without_values, flood_map, mapped_basins
from fvsolve.report.maps.map_figure import map_figure
from fvsolve.report.maps.network_figure import network_figure
from fvsolve.report.maps.network_map import network_map
from fvsolve.report.moving_scenes import moving_scene
from fvsolve.report.report_table import picture_address, report_table
from fvsolve.report.tables import ERROR_HEADER, Sentence, in_unit, open_reason, value_text
from fvsolve.units import span

TEMPLATE_FOLDER = Path(__file__).parent
MAX_SHARED_BINS = 900  # greatest number of bins of all sections together
MAX_PAPER_TITLE = 100  # greatest number of letters of the title on each printed page
MAX_WARNINGS = 40  # greatest number on the page; summary.json has all
SERIES_POINTS = 400  # greatest number of points of a series
# greatest numbers of probes and sections of an event, from its first run
MAX_PROBES, MAX_SECTIONS = 6, 2
MAX_FAILED_ROWS = 200  # greatest number of rows of limits that fail or are open
OWN_SCALE = (
    "Positions as stated; they do not agree with the lengths of pipes, so the plan has no scale."
)
DRAWN_LAYOUT = (
    "Drawn layout: not all nodes state a position. Distances approximate the lengths of pipes."
)
CAPTION = "Maximum (solid) and minimum (dashed) head over all accepted steps, by protection."


DECIMAL_SIGNS = {"point": ".", "comma": ","}


def page(result, ways: list[SectionPath]) -> str:
    """HTML text of the report of a run; ways : paths of its long sections."""
    with tables.with_decimal_sign(DECIMAL_SIGNS[report_table(result.case).decimal]):
        return _page(result, ways)


def _page(result, ways: list[SectionPath]) -> str:
    sections = [section_of(result, way) for way in ways]
    figures: dict[str, Any] = {}
    start = result.start_time
    probes = with_dates(tables.extremes_of_probes(result), start)
    told = [visible(text) for text in grouped_texts(item for item in result.warnings if item.ok)]
    if len(told) > MAX_WARNINGS:
        told[MAX_WARNINGS:] = [f"{len(told) - MAX_WARNINGS} more in summary.json"]
    places = all_with_dates([*tables.worst_tables(result), *tables.ranked_pipes(result)], start)
    events = (tables.cavities(result), tables.events(result))
    filled = {
        **_words(result),
        "scene": _moving_scene(result, figures),
        "invalid": not_valid(result.summary),
        "title": visible(result.summary["title"] or result.summary["case"]),
        "run": result.summary,
        "description": visible(result.case.description),
        "source": visible(result.case.source),
        "ended": result.summary.get("ended", ""),
        "words": tables.top_sentences(result),
        "maps": (maps := [*_maps(result, figures), *_network_plans(result, figures)]),
        "unmapped": [] if maps else basins_without_values(result),
        "limits": with_dates(tables.verdict_table(result), start),
        "worst": with_dates(tables.extremes_of_pipes(result, ways), start) or probes,
        "sections": _sections(result, sections, figures),
        "histories": _histories(result, figures),
        "probes_left_out": len(result.probes) - len(plots.chosen_probes(result)),
        "places": [*places, *[probes] * bool(probes and result.envelope)],
        "model": [*filter(None, tables.model_tables(result))],
        "numbers": [*filter(None, tables.numerics_tables(result))],
        "told": told,
        "happened": all_with_dates(events, start),
        "versions": tables.versions(result),
    }
    add_dates(figures, start)
    return render_page("page", filled, figures)


def add_dates(figures: dict[str, Any], start: Any) -> None:
    """Add the dates of the frames of all sliders to the data of figures; none without a start time.

    start : instant of t = 0, or None
    """
    for figure in figures.values() if start is not None else ():
        moving, frames = figure.get("moving"), figure.get("map", {}).get("frames")
        if moving is not None:
            moving["dates"] = [start.text(t) for t in moving["times"]]
        if frames is not None:
            frames["dates"] = [start.text(t) for t in frames["seconds"]]


def render_page(name: str, filled: dict[str, Any], figures: dict[str, Any]) -> str:
    """Render a template with its data, style, script, figures and the charting library embedded.

    name : "page" or "study"; filled : values of the template; figures : id -> data for plotly.js
    """
    files = {
        "table": "table.html.j2",
        "page": f"{name}.html.j2",
        "css": "page.css",
        "js": "page.js",
    }
    if any("map" in figure for figure in figures.values()):
        files["map_js"] = "maps/map.js"
    texts = {
        key: (TEMPLATE_FOLDER / file).read_text(encoding="utf-8") for key, file in files.items()
    }
    jinja = import_library("jinja2")
    options = {"trim_blocks": True, "lstrip_blocks": True, "undefined": jinja.StrictUndefined}
    # escapes all values, so that none becomes markup
    environment = jinja.Environment(autoescape=True, **options)
    for function in (tables.page_rows, tables.numeric_columns, tables.left_out):
        environment.filters[function.__name__] = function
    title = filled["title"]
    if len(title) > MAX_PAPER_TITLE:
        title = f"{title[: MAX_PAPER_TITLE - 1]}\u2026"
    # in the CSS string all but ASCII letters and digits are escaped, so that the title cannot end the string
    letters = [
        letter if letter.isascii() and letter.isalnum() else f"\\{ord(letter):x} "
        for letter in title
    ]
    return environment.from_string(texts["table"] + texts["page"]).render(
        filled,
        css=texts["css"],
        script=texts.get("map_js", "") + texts["js"],
        # so that the page needs no network
        library=import_library("plotly.offline").get_plotlyjs(),
        figures=script_json(figures),
        dark=json.dumps(plots.DARK_COLOURS),
        decimal=tables.decimal_sign(),
        paper=f'"{"".join(letters)}"',
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
    height = envelope_column(result, "max_head").unit
    along = envelope_column(result, "distance").unit
    entries, bins = [], min(MAX_BINS, MAX_SHARED_BINS // max(len(sections), 1))
    for k, item in enumerate(sections):
        line = moving[k] if moving else None
        figures[f"section-{k}"] = plots.section_figure(item, line, height, along, bins)
        entries.append(
            {
                "id": f"section-{k}",
                "name": visible(item.way.name),
                "length": f"{value_text(envelope_column(result, 'distance').from_si(item.way.length))} {along}",
                "frames": 0 if line is None else len(line.times),
                "pipes": len(item.way.legs),
                "parted": bool(item.cavity_spans),
            }
        )
    return entries


def _words(result) -> dict[str, Any]:
    """Values for the template from `[report]`: title block, logo, and texts as HTML."""
    table = report_table(result.case)
    markdown = import_library("markdown_it").MarkdownIt("commonmark", {"html": False})
    markdown.enable("table")
    return {
        "facts": [(word, visible(text)) for word, text in table.facts],
        "logo": picture_address(result.directory, table.logo),
        "before": markdown.render(table.before),
        "after": markdown.render(table.after),
    }


def _maps(result, figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Values for the template on the map of each basin; its figure is added to `figures`."""
    entries = []
    for k, basin in enumerate(mapped_basins(result)):
        plan = flood_map(result, basin)
        if not plan.layers:
            continue
        figure = map_figure(plan, result.case)
        figures[f"map-{k}"] = figure
        frames = figure["map"].get("frames")
        entries.append(
            {
                "id": f"map-{k}",
                "name": visible(basin),
                "frames": len(frames["data"]) if frames else 0,
                "stopped": visible(plan.stopped),
                "north": bool(plan.crs),
                "scaled": True,
                "kind": "raster",
                "note": "",
            }
        )
    return entries


def _moving_scene(result, figures: dict[str, Any]) -> dict[str, Any] | None:
    """Values for the template on the scene of bodies, if any; its pictures are added to `figures` under "scene"."""
    scene = moving_scene(result)
    if scene is None:
        return None
    if scene.pictures:
        figures["scene"] = {"pictures": scene.pictures, "moving": {"times": scene.times}}
    return {
        "frames": len(scene.pictures),
        "stored": scene.stored,
        "fault": visible(scene.fault),
        "first": scene.pictures[0] if scene.pictures else "",
    }


def _network_plans(result, figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Values for the template on the plan of the network, if any; its figure is added to `figures`."""
    plan = network_map(result) if result.directory is not None else None
    if plan is None:
        return []
    figures["map-network"] = network_figure(plan, result.case)
    note = "" if plan.scaled else OWN_SCALE if plan.stated else DRAWN_LAYOUT
    return [
        {
            "id": "map-network",
            "name": "Network",
            "frames": len(plan.frames),
            "stopped": visible(plan.stopped),
            "north": False,
            "scaled": plan.scaled,
            "kind": "lines",
            "note": note,
        }
    ]


def _histories(result, figures: dict[str, Any]) -> list[dict[str, Any]]:
    """Values for the template on each panel of histories; its figure is added to `figures`."""
    drawn = result.history_drawn()
    doubt = min((time for time, _ in drawn.get("marks", ())), default=None)
    entries = []
    for k, panel in enumerate(plots.history_panels(result)):
        figures[f"history-{k}"] = plots.history_figure(panel, drawn["time_unit"], doubt)
        hidden = sum(not line.seen for line in panel.lines)
        entries.append(
            {"id": f"history-{k}", "name": panel.quantity.replace("_", " "), "hidden": hidden}
        )
    return entries


def study_page(study: dict[str, Any], runs: list[tuple[dict[str, Any], Any]]) -> str:
    """HTML text of the report of a study, with the words of `[report]` of its first run."""
    with tables.with_decimal_sign(DECIMAL_SIGNS[report_table(runs[0][1].case).decimal]):
        return _study_page(study, runs)


def _study_page(study: dict[str, Any], runs: list[tuple[dict[str, Any], Any]]) -> str:
    figures: dict[str, Any] = {}
    first = runs[0][1]
    events = [
        {
            "id": f"event-{k}",
            "name": visible(name or "All runs"),
            "figures": event_figures(name, k, runs, figures),
        }
        for k, name in enumerate(dict.fromkeys(row["event"] for row, _ in runs))
    ]
    filled = {
        **_words(first),
        "title": visible(study["title"] or study["study"]),
        "said": study,
        "case": visible(first.summary["case"]),
        "ended": max(result.summary.get("ended", "") for _, result in runs),
        "version": first.summary["versions"]["fvsolve"],
        "description": visible(first.case.description),
        "words": study_sentences(study, runs),
        "matrix": [
            run_matrix(runs),
            *filter(None, [with_dates(extreme_pressures(runs), first.start_time)]),
        ],
        "events": events,
        "failing": failing_limits(runs),
        "changes": change_tables(study),
        "first": run_name(runs[0][0]),
        "model": [table for table in tables.model_tables(first) if table is not None],
        "told": warning_texts(runs),
        "versions": tables.versions(first),
    }
    return render_page("study", filled, figures)


def run_name(row: dict[str, Any]) -> str:
    """Name of a run from its event and protection, such as `trip with vessel`; row : row of study.json."""
    return visible(
        " with ".join(name for name in (row["event"], row["protection"]) if name) or "the case"
    )


def study_sentences(study: dict[str, Any], runs: list) -> list[Sentence]:
    """Sentences at the top of the report of a study, on runs that stopped early or are not valid, and on limits."""
    sentences = [
        Sentence("bad", f"{run_name(row)} stopped early.", f"{result.reason}.")
        for row, result in runs
        if result.reason != "finished"
    ]
    sentences += [
        Sentence("bad", f"{run_name(row)} is not to be trusted.", item.text)
        for row, result in runs
        for item in result.warnings
        if not item.ok
    ]
    if doubted := [item for item in runs if item[1].marks]:
        marks = [mark for _, result in doubted for mark in result.marks]
        reasons = {mark.what: mark.text.partition(": ")[2].partition(";")[0] for mark in marks}
        text = f"{'; '.join(reasons.values())}."
        sentences.append(Sentence("doubt", "Partly not to be trusted:", text, run_links(doubted)))
    if not any(result.verdicts for _, result in runs):
        text = "The study shows what happens, but not whether this is allowed."
        return [*sentences, Sentence("none", "No limits were stated.", text)]
    names = [visible(name) or "the unchanged case" for name in study["holds"]]
    without = "" if all("resolution" in row for row, _ in runs) else tables.WITHOUT_ERROR
    if names:
        sentences.append(
            Sentence("good", f"All limits hold in all events with {', '.join(names)}.", without)
        )
    else:
        sentences.append(Sentence("bad", "No protection holds all limits in all events.", ""))
    if failed := [item for item in runs if run_state(item[1]) == FAILS]:
        sentences.append(Sentence("bad", "Fails:", "", run_links(failed)))
    if unsure := [item for item in runs if run_state(item[1]) == OPEN]:
        reasons = dict.fromkeys(open_reason(result) for _, result in unsure)
        sentences.append(Sentence("doubt", "Open:", f"{'; '.join(reasons)}.", run_links(unsure)))
    return sentences


def run_state(result) -> str:
    """Worst state of the limits of a run: `FAILS`, `OPEN` or `HOLDS`; "" without limits.

    For a run that is not ok the state is `FAILS`.
    """
    states = [FAILS] * (not result.ok) + [item.state for item in result.verdicts]
    return next((item for item in (FAILS, OPEN, HOLDS) if item in states), "")


def run_links(runs: list) -> tuple[tuple[str, str], ...]:
    """Names of runs and the addresses of their reports, as pairs."""
    return tuple((run_name(row), row["page"]) for row, _ in runs)


def run_matrix(runs: list) -> ResultTable:
    """Table with a row for each run: verdict and the margin of each limit, with a link to its report."""
    names = {verdict.name: verdict.unit for _, result in runs for verdict in result.verdicts}
    with_error = any(verdict.error is not None for _, result in runs for verdict in result.verdicts)
    rows = []
    for row, result in runs:
        verdicts = {verdict.name: verdict for verdict in result.verdicts}
        no_margin = not_valid(result.summary) or None
        margins = [
            no_margin if key == "margin" and value is None and name in verdicts else value
            for name in names
            for key in ("margin", *["error"] * with_error)
            for value in [getattr(verdicts.get(name), key, None)]
        ]
        rows.append([run_name(row), IN_WORDS.get(run_state(result), ""), *margins])
    heads = ["run", "verdict"]
    heads += [
        word for name in names for word in (f"margin of {name}", *[ERROR_HEADER] * with_error)
    ]
    units = ["", ""] + [span(unit) for unit in names.values() for _ in range(1 + with_error)]
    bad = frozenset(k for k, (_, result) in enumerate(runs) if run_state(result) == FAILS)
    return ResultTable.of("Runs", heads, rows, units, bad, links=[row["page"] for row, _ in runs])


def extreme_pressures(runs: list) -> ResultTable | None:
    """Table of the greatest and least pressure over all pipes of each run, with pipe, distance and time.

    It is None if no run has pipes with cells.
    """
    rows, columns = [], ()
    for row, result in runs:
        table = tables.extremes_of_pipes(result, [])
        if table is None:
            continue
        columns = tuple(envelope_column(result, key).unit for key in ("distance", "t_max"))
        for values in table.values[:2]:
            rows.append([run_name(row), *values[:5], values[-1]])
    if not rows:
        return None
    heads = ("run", "", "value", "unit", "pipe", "from its start", "time")
    units = ("", "", "", "", "", *columns)
    return ResultTable.of("Extreme pressures", heads, rows, units, mixed=frozenset({2}))


def failing_limits(runs: list) -> ResultTable:
    """Table of the limits that fail or are open in each run, with position and time."""
    length, time = (column("", dimension, runs[0][1].case) for dimension in ("length", "time"))
    pages = [row["page"] for row, result in runs for item in result.verdicts if not item.ok]
    rows = [
        [
            run_name(row),
            item.name,
            IN_WORDS[item.state],
            item.value,
            item.limit,
            item.unit,
            item.margin,
            span(item.unit),
            item.place,
            in_unit(length, item.chainage),
            in_unit(time, item.time),
        ]
        for row, result in runs
        for item in result.verdicts
        if not item.ok
    ]
    heads = (
        "run",
        "limit",
        "verdict",
        "value",
        "allowed",
        "unit",
        "margin",
        "unit",
        "worst place",
        "chainage",
        "time",
    )
    units = ("",) * 9 + (length.unit, time.unit)
    table = ResultTable.of(
        "", heads, rows, units, mixed=frozenset({3, 4, 6}), most=MAX_FAILED_ROWS, links=pages
    )
    return with_dates(table, runs[0][1].start_time)


def change_tables(study: dict[str, Any]) -> list[ResultTable]:
    """Tables of the keys that events and protections set, with their values in TOML."""
    tables = []
    for group in ("events", "protections"):
        rows = [
            [name, key, inline(value)]
            for name, keys in study["changes"][group].items()
            for key, value in keys.items()
        ]
        tables += (
            [ResultTable.of(group.capitalize(), (group[:-1], "key", "value"), rows)] if rows else []
        )
    return tables


def event_figures(
    event: str | None, number: int, runs: list, figures: dict[str, Any]
) -> list[dict[str, Any]]:
    """Values for the template on the figures of an event, each of which shows the runs of all protections.

    event : name of the event; number : its number, for the keys under which the figures are added to `figures`
    """
    own = [(row["protection"] or "", result) for row, result in runs if row["event"] == event]
    runs_drawn = [(name, result, section_paths(result)) for name, result in own]
    entries = []
    for k, first in enumerate(
        next((paths for *_, paths in runs_drawn if paths), [])[:MAX_SECTIONS]
    ):
        several = [
            (name, section_of(result, path))
            for name, result, paths in runs_drawn
            for path in paths
            if path.name == first.name
        ]
        height = envelope_column(own[0][1], "max_head").unit
        along = envelope_column(own[0][1], "distance").unit
        figures[f"section-{number}-{k}"] = plots.study_section_figure(several, height, along)
        entries.append(
            {"id": f"section-{number}-{k}", "name": visible(first.name), "caption": CAPTION}
        )
    shared = [name for name in own[0][1].probes if all(name in result.units for _, result in own)]
    for k, probe in enumerate(shared[:MAX_PROBES]):
        lines = [
            plots.Series(
                name or "the case",
                *thin_series(result.drawn_times, result[probe], SERIES_POINTS),
                seen=True,
            )
            for name, result in own
        ]
        panel = plots.HistoryPanel(probe_quantity(probe), own[0][1].units[probe], lines)
        figures[f"history-{number}-{k}"] = plots.history_figure(panel, own[0][1].drawn_unit, None)
        entries.append({"id": f"history-{number}-{k}", "name": visible(probe), "caption": ""})
    return entries


def warning_texts(runs: list) -> list[str]:
    """First `MAX_WARNINGS` texts of warnings of all runs, each once, with the names of the runs in which it occurs.

    Warnings of a run that differ in their place and numbers alone are a single text.
    """
    by_text: dict[str, list[str]] = {}
    for row, result in runs:
        for text in grouped_texts(result.warnings):
            by_text.setdefault(text, []).append(run_name(row))
    texts = [
        f"{text} ({', '.join(names) if len(names) < len(runs) else 'all runs'})"
        for text, names in by_text.items()
    ]
    return [visible(item) for item in texts[:MAX_WARNINGS]]
