"""Conversion of an EPANET file to the text of a case file."""

import math
from dataclasses import dataclass
from pathlib import Path

from fvsolve.case import text
from fvsolve.errors import FvsolveError, listing
from fvsolve.exchange.epanet.day import DayTranslation
from fvsolve.exchange.epanet.network_file import (
    EpanetNetwork,
    EpanetSolution,
    read_network,
    solution_at,
)
from fvsolve.exchange.epanet.part_tables import DENSITY, GRAVITY, WATER_VISCOSITY
from fvsolve.exchange.epanet.switching import DAY
from fvsolve.exchange.epanet.translating import Translation
from fvsolve.parts.pipe.part import QUASI_STEADY

CELL_TIME = 0.01  # travel time of a cell in small networks [s]
MOST_CELLS = 40_000  # largest number of cells; larger networks get longer cells
END = "20 s"
DAY_RTOL, DAY_ROWS = 1e-6, "5 min"  # tolerance of a run over a day, and its interval of rows
PROBES = 5  # number of recorded junctions: those with the largest demands


@dataclass(frozen=True)
class Imported:
    """Case file imported from EPANET.

    text : text of the case file; nodes, links : EPANET's name -> name in the case
    notes : differences from EPANET, as a list of (text, EPANET's names)
    short_pipes : EPANET's names of pipes shorter than a cell, the shortest first
    network : contents of the file; solution : EPANET's solution at the imported hour
    causes : notes on what makes heads or flows differ from EPANET; start_causes : at the start alone
    """

    text: str
    nodes: dict[str, str]
    links: dict[str, str]
    notes: list[tuple[str, list[str]]]
    short_pipes: list[str]
    network: EpanetNetwork
    solution: EpanetSolution
    causes: list[str]
    start_causes: list[str]


def import_network(
    path: str | Path,
    hour: float = 0.0,
    wave_speed: float = 1200.0,
    shortest: float = 0.0,
    day: bool = False,
    duration: float = DAY,
    required_pressure: float = 0.0,
) -> Imported:
    """Import an EPANET file with the state at an hour of EPANET's run, or for a day.

    day : True for a run from hour 0 with patterns, controls and rules, and with pipes that follow their losses at once;
    duration : of this run [s]; the other arguments then have no effect
    hour : time from the start of EPANET's run [h]; wave_speed : wave speed of every pipe [m/s]
    shortest : least length of a pipe in the case [m]; a shorter pipe is lengthened, and keeps the friction loss of its
    original length
    required_pressure : head of water [m] from which demands are full, as those of EPANET's PDA; 0 for demands as in the
    file
    Raises FvsolveError for an invalid hour, if file or toolkit are missing, or if EPANET finds faults in the file.
    """
    if not (math.isfinite(hour) and hour >= 0.0):
        raise FvsolveError(
            f"hour {hour:g} is not valid; expected hours from the start of EPANET's run, 0 or more"
        )
    network = read_network(Path(path), required_pressure)
    solution = solution_at(network, 0.0 if day else hour).solutions[0]
    if day:
        translation: Translation = DayTranslation(network, solution, duration)
        title = f"{Path(path).stem} over {'a day' if duration == DAY else f'{duration / 3600.0:g} h'}, from EPANET"
        lines, short = _day_lines(translation), []
    else:
        time = cell_time(
            [link.length for link in network.links.values() if link.kind == "pipe"], wave_speed
        )
        translation = Translation(network, solution, wave_speed, shortest)
        lengths = translation.lengths
        short = sorted(
            (name for name, length in lengths.items() if length < wave_speed * time),
            key=lengths.get,
        )
        title = f"{Path(path).stem} at hour {hour:g}, from EPANET"
        lines = _hour_lines(translation, time, short)
    case_text = _text(Path(path), network, translation, title, lines)
    names = translation.node_names.given, translation.link_names.given
    return Imported(
        case_text,
        *names,
        translation.notes,
        short,
        network,
        solution,
        translation.causes,
        translation.start_causes,
    )


def cell_time(lengths: list[float], wave_speed: float) -> float:
    """Travel time of a cell [s], rounded to two digits: 10 ms, or longer for at most `MOST_CELLS` cells.

    lengths : lengths of all pipes [m]; wave_speed : [m/s]
    """
    return float(f"{max(CELL_TIME, sum(lengths) / wave_speed / MOST_CELLS):.2g}")


def _text(
    path: Path, network: EpanetNetwork, translation: Translation, title: str, closing: list[str]
) -> str:
    """Text of the case file; closing : its lines after nodes and links"""
    lines = ["#:schema schema.json", "schema = 1", f"title = {text.inline(title)}"]
    description = " ".join(line.strip() for line in network.title)
    if description:
        lines.append(f"description = {text.inline(description)}")
    lines += [f"source = {text.inline(f'{path.name}, by fvsolve import')}"]
    lines += ["", "# Differences from EPANET:"] if translation.notes else []
    lines += [f"# - {note}: {listing(names, 60)}" for note, names in translation.notes]
    density = DENSITY * network.options["gravity"]
    lines.append(f'gravity = "{GRAVITY:.10g} m/s2"  # of EPANET: 32.2 ft/s2')
    lines += ["", "[fluid]", 'name = "Water"', 'temperature = "20 degC"', 'law = "linear"']
    lines.append(f'density = "{density:.10g} kg/m3"  # EPANET\'s weight of water')
    if translation.formula == "D-W":
        lines.append(
            f'viscosity = "{1e6 * WATER_VISCOSITY * network.options["viscosity"]:.7g} cSt"'
        )
    for group in ("nodes", "links"):
        lines += ["", f"[{group}]"]
        lines += [
            f"{name} = {text.inline(part)}" for name, part in getattr(translation, group).items()
        ]
    return "\n".join(lines + closing) + "\n"


def _hour_lines(translation: Translation, time: float, short: list[str]) -> list[str]:
    """Lines of numerics and output for a run of seconds; time : of a cell [s]; short : pipes shorter than a cell"""
    return [
        "",
        "[numerics]",
        f'end = "{END}"',
        f'cell_time = "{1e3 * time:.10g} ms"  # pipes with a shorter travel time get one cell',
        'pipe_model = "auto"'
        + (f"  # {_short_pipes_comment(translation, short)}" if short else ""),
        "",
        "[output]",
        f"probes = {text.inline(_probes(translation))}",
        'units = { flow = "l/s", pressure = "barg" }',
    ]


def _day_lines(translation: DayTranslation) -> list[str]:
    """Lines of signals, controls, numerics and output for a run over a day."""
    lines = []
    if translation.energy:
        lines += [
            "",
            "[energy]",
            *(f"{key} = {text.inline(value)}" for key, value in translation.energy.items()),
        ]
    for group in ("signals", "controls"):
        if table := getattr(translation, group):
            lines += [
                "",
                f"[{group}]",
                *(f"{name} = {text.inline(part)}" for name, part in table.items()),
            ]
    numerics = [
        f'end = "{translation.end / 3600.0:g} h"',
        f'pipe_model = "{QUASI_STEADY}"',
        f"rtol = {DAY_RTOL:g}",
    ]
    probes = f"probes = {text.inline(_probes(translation))}"
    output = [
        f'every = "{DAY_ROWS}"',
        probes,
        'units = { flow = "l/s", pressure = "barg", time = "h" }',
    ]
    return [*lines, "", "[numerics]", *numerics, "", "[output]", *output]


def _short_pipes_comment(translation: Translation, short: list[str]) -> str:
    """Comment for the case file on the pipes that are shorter than a cell; short : their names in EPANET"""
    first = translation.link_names.given[short[0]]
    pipes = f"{first} is" if len(short) == 1 else f"{len(short)} pipes are"
    length = f"{translation.lengths[short[0]]:.4g} m"
    return f"{pipes} shorter than a cell; with cells, {first} of {length} would limit the steps"


def _probes(translation: Translation) -> list[str]:
    """Names of probes: levels of tanks, flows of pumps, heads of the `PROBES` junctions with the largest demands."""
    nodes, links = translation.nodes, translation.links
    probes = [f"nodes.{name}.level" for name, part in nodes.items() if part["type"] == "tank"]
    probes += [f"links.{name}.flow" for name, part in links.items() if part["type"] == "pump"]
    demands = translation.demands
    greatest = sorted(demands, key=demands.get, reverse=True)[:PROBES]
    return probes + [f"nodes.{name}.head" for name in greatest]
