"""Pictures of a run without a browser: long sections, histories by choice, phase planes. Knows runs; draws nothing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fvsolve.draw.plot import history_figure
from fvsolve.draw.section import phase_figure, section_figure
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.report.heads import in_units
from fvsolve.report.legs import SectionWay, ways
from fvsolve.report.report import opened
from fvsolve.report.section import section, window
from fvsolve.run.result import not_valid
from fvsolve.shown import kept
from fvsolve.units import show


def write_pictures(
    directory: str | Path, probes: str = "", route: str = "", phases: Sequence[str] = (), out: str | Path | None = None
) -> list[Path]:
    """Draw what is asked for into `out`, the run directory by default; their paths.

    probes : names with commas between them, of probes.png; route : a section, all where nothing is asked for;
    phases : "X:Y", two probes, of phase.png. Raises RunError, FvsolveError with all names that are none.
    """
    result, folder = opened(Path(directory)), Path(out) if out is not None else Path(directory)
    faults: list[str] = []
    picked = chosen(result, probes, faults)
    pairs = [_pair(result, text, faults) for text in phases]
    found = _sections(ways(result), route, bool(picked or phases), faults)
    if faults:
        raise FvsolveError("\n".join(faults))
    title, drawn = result.summary["title"], {}
    for k, way in enumerate(found, 1):
        drawn["section.png" if len(found) == 1 else f"section-{k}.png"] = _section_figure(result, way)
    if picked:
        told = result.history_drawn()
        columns = [result.probes.index(name) for name in picked]
        measured = {name: one for name, one in told["measured"].items() if name in picked}
        drawn["probes.png"] = history_figure(**{**told, "values": told["values"][:, columns], "measured": measured,
                                                "probes": [told["probes"][k] for k in columns]})  # fmt: skip
    if pairs:
        drawn["phase.png"] = phase_figure([[(n, result.units[n], result[n]) for n in pair] for pair in pairs], title)
    if not drawn:
        why = f"run is {text}" if (text := not_valid(result.summary)) else "case has no pipes"
        raise FvsolveError(f"{directory}: the {why}, so no long section; name --probes or --phase X:Y")
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in drawn.items():
        kept(figure, folder / name)
    return [folder / name for name in drawn]


def chosen(result, text: str, faults: list[str]) -> list[str]:
    """`a.head,tank.depth@1,2` as names of probes, which may have commas themselves; what is none is a fault."""
    found, pieces = [], [piece.strip() for piece in text.split(",")] if text else []
    while pieces:
        ends = [k for k in range(1, len(pieces) + 1) if ",".join(pieces[:k]) in result.units]
        many = ends[-1] if ends else 1
        name, pieces = ",".join(pieces[:many]), pieces[many:]
        if ends:
            found.append(name)
        else:
            faults.append(_none(result, name))
    return list(dict.fromkeys(found))


def _pair(result, text: str, faults: list[str]) -> list[str]:
    names = [name.strip() for name in text.split(":")]
    if len(names) != 2:
        faults.append(f"--phase {show(text)}: wanted two probes, X:Y")
    faults += [_none(result, name) for name in names if len(names) == 2 and name not in result.units]
    return names


def _none(result, name: str) -> str:
    near = did_you_mean(name, result.units) or f"; they are {listing(result.units) or 'none'}"
    return f"no probe {show(name)} was recorded{near}"


def _sections(found: list[SectionWay], route: str, others: bool, faults: list[str]) -> list[SectionWay]:
    """The sections that are to be drawn."""
    if not route:
        return [] if others else found
    named = [way for way in found if way.name == route]
    if not named:
        names = [way.name for way in found]
        near = did_you_mean(route, names) or f"; they are {listing(names) or 'none'}"
        faults.append(f"no route {show(route)}{near}")
    return named


def _section_figure(result, way: SectionWay):
    one = section(result, way)
    k, title = one.picked(), "\n".join(filter(None, [result.summary["title"], way.name]))
    return section_figure(
        one.chainage[k], {name: values[k] for name, values in one.along.items()}, result.summary["envelope_units"],
        {name: line[k] for name, line in one.lines.items()}, window([one], in_units(result, "greatest_head").unit),
        one.parted, one.beyond, [device.chainage for device in one.devices], one.labels(), title,
    )  # fmt: skip
