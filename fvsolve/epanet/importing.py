"""From an EPANET file to the text of a case. Knows the file's layout; the parts are translated elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fvsolve.case import text
from fvsolve.epanet.reading import read_network, state_at
from fvsolve.epanet.translating import Translation
from fvsolve.epanet.words import DENSITY
from fvsolve.errors import FvsolveError, listing

CELL_TIME = 0.01  # [s] of a cell where there are few of them
MOST_CELLS = 40_000  # beyond which cells grow
END = "20 s"
PROBES = 5  # junctions that are recorded: those with the greatest demands


@dataclass(frozen=True)
class Imported:
    """Text of a case file, and what in it is not as EPANET has it: (what, names).

    nodes, links : EPANET's name -> the case's; short : EPANET's names of pipes shorter than a cell, the shortest first
    """

    text: str
    nodes: dict[str, str]
    links: dict[str, str]
    notes: list[tuple[str, list[str]]]
    short: list[str]


def import_network(path: str | Path, hour: float = 0.0, wave_speed: float = 1200.0, shortest: float = 0.0) -> Imported:
    """The case of an EPANET file at an hour of EPANET's own run; every pipe gets one wave speed [m/s].

    shortest : what shorter pipes are made as long as, with the loss of their own length [m]
    Raises FvsolveError where WNTR is absent, or where EPANET finds faults in the file.
    """
    if not (math.isfinite(hour) and hour >= 0.0):
        raise FvsolveError(f"hour {hour:g}; wanted hours from the start of EPANET's run, 0 or more")
    network = read_network(Path(path))
    time = cell_time([pipe.length for _, pipe in network.pipes()], wave_speed)
    made = Translation(network, state_at(network, hour), wave_speed, shortest)
    short = sorted((name for name, length in made.lengths.items() if length < wave_speed * time), key=made.lengths.get)
    said = _text(Path(path), network, made, hour, time, short)
    return Imported(said, made.node_names.given, made.link_names.given, made.notes, short)


def cell_time(lengths: list[float], wave_speed: float) -> float:
    """Travel time [s] of a cell: 10 ms, or what keeps all pipes within `MOST_CELLS`, in two digits."""
    return float(f"{max(CELL_TIME, sum(lengths) / wave_speed / MOST_CELLS):.2g}")


def _text(path: Path, network: Any, made: Translation, hour: float, time: float, short: list[str]) -> str:
    lines = [
        "#:schema schema.json",
        "schema = 1",
        f"title = {text.inline(f'{path.stem} at hour {hour:g}, from EPANET')}",
    ]
    said = " ".join(line.strip() for line in network.title if line.strip())
    if said:
        lines.append(f"description = {text.inline(said)}")
    lines += [f"source = {text.inline(f'{path.name}, by fvsolve new --from')}"]
    lines += ["", "# Not as EPANET has it:"] if made.notes else []
    lines += [f"# - {what}: {listing(names, 60)}" for what, names in made.notes]
    density = DENSITY * network.options.hydraulic.specific_gravity
    lines += ["", "[fluid]", 'name = "Water"', 'temperature = "20 degC"', 'law = "linear"']
    lines.append(f'density = "{density:.10g} kg/m3"  # EPANET\'s weight of water')
    if made.formula == "D-W":
        lines.append(f'viscosity = "{1.022 * network.options.hydraulic.viscosity:.6g} cSt"')
    for group in ("nodes", "links"):
        lines += ["", f"[{group}]"]
        lines += [f"{name} = {text.inline(part)}" for name, part in getattr(made, group).items()]
    lines += [
        "",
        "[numerics]",
        f'end = "{END}"',
        f'cell_time = "{1e3 * time:.10g} ms"  # pipes that are shorter get one cell',
        'line = "auto"' + (f"  # {_short(made, short)}" if short else ""),
    ]
    lines += ["", "[output]", f"probes = {text.inline(_probes(made))}", 'units = { flow = "l/s", pressure = "barg" }']
    return "\n".join(lines) + "\n"


def _short(made: Translation, short: list[str]) -> str:
    """What cells would cost where pipes are shorter than one."""
    first = made.link_names.given[short[0]]
    which = f"{first} is" if len(short) == 1 else f"{len(short)} pipes are"
    return f"{which} shorter than a cell; with cells steps follow {first}, {made.lengths[short[0]]:.4g} m long"


def _probes(made: Translation) -> list[str]:
    """Levels of tanks, flows of pumps and heads of the greatest demands."""
    nodes, links = made.nodes, made.links
    found = [f"nodes.{name}.level" for name, part in nodes.items() if part["type"] == "tank"]
    found += [f"links.{name}.flow" for name, part in links.items() if part["type"] == "pump"]
    demands = {name: float(part["demand"].split()[0]) for name, part in nodes.items() if "demand" in part}
    most = sorted(demands, key=demands.get, reverse=True)[:PROBES]
    return found + [f"nodes.{name}.head" for name in most]
