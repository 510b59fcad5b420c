"""Picture files of a run: long sections, histories of chosen probes, and phase planes."""

from collections.abc import Sequence
from pathlib import Path

from fvsolve.display import save_if_path
from fvsolve.draw.plot import history_figure, phase_figure, section_figure
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.report.long_section import SectionPath, envelope_column, head_window, section_of, section_paths
from fvsolve.report.report_files import open_checked_run
from fvsolve.run.result import not_valid
from fvsolve.units import show


def write_pictures(
    directory: str | Path, probes: str = "", route: str = "", phases: Sequence[str] = (), out: str | Path | None = None
) -> list[Path]:
    """Write pictures of a run into the folder `out` (default: the run directory); returns their paths.

    probes : names separated by commas, drawn in probes.png
    route : name of a section; all sections are drawn if probes, route and phases are empty
    phases : pairs of probes "X:Y", drawn in phase.png
    Raises RunError if the directory holds no finished run, FvsolveError with all unknown names, or if there is nothing
    to draw.
    """
    result, folder = open_checked_run(Path(directory)), Path(out) if out is not None else Path(directory)
    faults: list[str] = []
    picked = parse_probes(result, probes, faults)
    pairs = [_phase_pair(result, text, faults) for text in phases]
    sections = _chosen_sections(section_paths(result), route, bool(picked or phases), faults)
    if faults:
        raise FvsolveError("\n".join(faults))
    title, drawn = result.summary["title"], {}
    for k, way in enumerate(sections, 1):
        section = section_of(result, way)
        window = head_window([section], envelope_column(result, "max_head").unit)
        names = "\n".join(filter(None, [title, way.name]))
        figure = section_figure(section, window, result.summary["envelope_units"], names)
        drawn["section.png" if len(sections) == 1 else f"section-{k}.png"] = figure
    if picked:
        data = result.history_drawn()
        columns = [result.probes.index(name) for name in picked]
        measured = {name: series for name, series in data["measured"].items() if name in picked}
        drawn["probes.png"] = history_figure(**{**data, "values": data["values"][:, columns], "measured": measured,
                                                "probes": [data["probes"][k] for k in columns]})  # fmt: skip
    if pairs:
        drawn["phase.png"] = phase_figure([[(n, result.units[n], result[n]) for n in pair] for pair in pairs], title)
    if not drawn:
        reason = f"run is {text}" if (text := not_valid(result.summary)) else "case has no pipes"
        raise FvsolveError(f"{directory}: the {reason}, so it has no long section. Choose --probes or --phase X:Y")
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in drawn.items():
        save_if_path(figure, folder / name)
    return [folder / name for name in drawn]


def parse_probes(result, text: str, faults: list[str]) -> list[str]:
    """Names of probes in a list such as `a.head,tank.depth@1,2`, in which a name may contain commas.

    Unknown names are added to `faults`.
    """
    names, pieces = [], [piece.strip() for piece in text.split(",")] if text else []
    while pieces:
        ends = [k for k in range(1, len(pieces) + 1) if ",".join(pieces[:k]) in result.units]
        n = ends[-1] if ends else 1
        name, pieces = ",".join(pieces[:n]), pieces[n:]
        if ends:
            names.append(name)
        else:
            faults.append(_unknown_probe(result, name))
    return list(dict.fromkeys(names))


def _phase_pair(result, text: str, faults: list[str]) -> list[str]:
    names = [name.strip() for name in text.split(":")]
    if len(names) != 2:
        faults.append(f"--phase {show(text)}: expected two probes, X:Y")
    faults += [_unknown_probe(result, name) for name in names if len(names) == 2 and name not in result.units]
    return names


def _unknown_probe(result, name: str) -> str:
    hint = did_you_mean(name, result.units) or f"; the run has {listing(result.units) or 'none'}"
    return f"{show(name)}: unknown probe{hint}"


def _chosen_sections(sections: list[SectionPath], route: str, others: bool, faults: list[str]) -> list[SectionPath]:
    """Sections to draw: the section `route`, or all sections unless `others` (probes or phase planes) are drawn.

    Adds an unknown route to `faults`.
    """
    if not route:
        return [] if others else sections
    named = [way for way in sections if way.name == route]
    if not named:
        names = [way.name for way in sections]
        hint = did_you_mean(route, names) or f"; the run has {listing(names) or 'none'}"
        faults.append(f"{show(route)}: unknown route{hint}")
    return named
