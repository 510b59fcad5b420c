"""EPANET files as a network, and EPANET's solution at an hour of its run, both read by EPANET's own toolkit."""

import importlib.util
import json
import math
import platform
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from fvsolve.compile.child_process import python_command, python_environment
from fvsolve.errors import FvsolveError
from fvsolve.exchange.epanet import toolkit_process

TIME_LIMIT = 600.0  # of EPANET's process [s]
FOOT = 0.3048
US_UNITS = toolkit_process.US_UNITS
# Remedies for EPANET's error codes (its manual, appendix B)
REMEDIES = {
    201: "expected the keywords and numbers of this section in EPANET 2.2, with decimal points",
    202: "expected a number",
    203: "expected a node of [JUNCTIONS], [RESERVOIRS] or [TANKS]",
    204: "expected a link of [PIPES], [PUMPS] or [VALVES]",
    205: "expected a pattern of [PATTERNS]",
    206: "expected a curve of [CURVES]",
    207: "a pipe with a check valve cannot be controlled; remove the control, or the check valve",
    208: "expected a node that the file defines",
    209: "expected a value in the range that EPANET's manual states",
    211: "expected a value in the range that EPANET's manual states",
    213: "expected a number above 0, or a keyword of this section",
    215: "give each node and each link a name of its own",
    219: "a PRV, PSV or FCV cannot be next to a tank or reservoir; add a short pipe",
    220: "two such valves cannot share a node or be in series; add a pipe between both",
    222: "give the link two different nodes",
    223: "expected at least two nodes, one of them a tank or reservoir",
    224: "add a tank or reservoir",
    225: "expected a level between the minimum and maximum level of the tank",
    226: "give the pump the keyword HEAD and a curve, or POWER",
    227: "expected points with rising flow and falling head",
    230: "expected points with rising first coordinates",
    233: "join the node to a link, or remove it",
}


@dataclass(frozen=True)
class EpanetNode:
    """A node of an EPANET file in SI.

    kind : "junction", "reservoir" or "tank"; elevation : of a reservoir its head [m]; position : coordinates, or None
    demands : list of (base demand [m3/s], index of its pattern or 0); emitter : flow [m3/s] at 1 m of water
    pattern : index of the pattern of the head of a reservoir, or 0
    level, minimum, maximum : levels of a tank above its bottom [m]; diameter [m]
    volume : points (level [m], volume [m3]), or None; overflow : True if a full tank spills
    """

    name: str
    kind: str
    elevation: float
    position: list[float] | None = None
    demands: list[tuple[float, int]] = field(default_factory=list)
    emitter: float = 0.0
    pattern: int = 0
    level: float = 0.0
    minimum: float = 0.0
    maximum: float = 0.0
    diameter: float = 0.0
    volume: list[list[float]] | None = None
    overflow: bool = False


@dataclass(frozen=True)
class EpanetLink:
    """A link of an EPANET file in SI.

    kind : "pipe", "pump" or the code of a valve; start, end : names of nodes
    status : "open", "closed" or "active" before hour 0, a valve that is "open" or "closed" does not regulate
    setting : relative speed of a pump, head of water [m] of PRV, PSV, PBV, flow [m3/s] of FCV, loss coefficient of TCV,
    opening in percent of PCV; roughness : as in the file, with D-W [m]
    curve : points of the head law of a pump (flow [m3/s], head [m]), of a GPV (flow [m3/s], loss [m]), of a PCV
    (opening, share of the flow area)
    power [W] : of a pump of constant power; pattern : index of the pattern of the speed
    efficiency_curve : points (flow [m3/s], efficiency 0 to 1); price : per kWh; price_pattern : index
    leak_area : of a pipe, as in the file
    """

    name: str
    kind: str
    start: str
    end: str
    status: str
    length: float = 0.0
    diameter: float = 0.0
    minor_loss: float = 0.0
    roughness: float = 0.0
    check_valve: bool = False
    leak_area: float = 0.0
    setting: float = 0.0
    power: float | None = None
    curve: list[list[float]] | None = None
    pattern: int = 0
    efficiency_curve: list[list[float]] | None = None
    price: float = 0.0
    price_pattern: int = 0


@dataclass(frozen=True)
class EpanetNetwork:
    """Contents of an EPANET file in SI.

    options, times : as `toolkit_process.contents` names them, times in s
    nodes, links : name -> node, link; patterns : list of (name, values); index 1 is the first
    controls, rules : as `toolkit_process` reads them; rewritten : lines of EPANET 1 that were rewritten
    required_pressure : head of water [m] from which demands that depend on pressure are full; 0 for demands of the file
    """

    path: Path
    title: list[str]
    units: str
    options: dict[str, Any]
    times: dict[str, int]
    nodes: dict[str, EpanetNode]
    links: dict[str, EpanetLink]
    patterns: list[tuple[str, list[float]]]
    controls: list[dict[str, Any]]
    rules: list[dict[str, Any]]
    rewritten: list[str]
    required_pressure: float = 0.0

    @property
    def us_units(self) -> bool:
        """True if the units of the file are those of the United States."""
        return self.units in US_UNITS

    def tanks(self) -> list[EpanetNode]:
        """Tanks, without reservoirs."""
        return [node for node in self.nodes.values() if node.kind == "tank"]

    @cached_property
    def links_at(self) -> dict[str, list[EpanetLink]]:
        """Name of a node -> its links."""
        found = defaultdict(list)
        for link in self.links.values():
            for end in (link.start, link.end):
                found[end].append(link)
        return found

    def supplied(self, is_way: Callable[[EpanetLink], bool]) -> set[str]:
        """Names of the nodes that water can reach from reservoirs and tanks through the links that are ways.

        Water passes pumps, check valves, PRVs and PSVs in one direction only.
        """
        reached = {name for name, node in self.nodes.items() if node.kind != "junction"}
        waiting = list(reached)
        while waiting:
            place = waiting.pop()
            for link in self.links_at[place]:
                is_directed = link.kind in ("pump", "PRV", "PSV") or link.check_valve
                if not is_way(link) or (is_directed and link.start != place):
                    continue
                new = {link.start, link.end} - reached
                reached |= new
                waiting += new
        return reached

    def pattern_at(self, index: int, seconds: float) -> float:
        """Value of a pattern at a time of the run [s]; 1 for the index 0."""
        if index <= 0:
            return 1.0
        values = self.patterns[index - 1][1]
        return values[
            math.floor((seconds + self.times["pattern_start"]) / self.times["pattern_step"])
            % len(values)
        ]

    def demand_pattern(self, index: int) -> int:
        """Index of the pattern of a demand: the default pattern of the file for the index 0."""
        return index or self.options["default_pattern"]

    def demand_at(self, node: EpanetNode, seconds: float) -> float:
        """Demand of a junction at a time of the run, from its patterns [m3/s]."""
        amounts = (
            base * self.pattern_at(self.demand_pattern(index), seconds)
            for base, index in node.demands
        )
        return self.options["multiplier"] * sum(amounts)


@dataclass(frozen=True)
class EpanetSolution:
    """EPANET's solution at a time of its run; each dictionary is EPANET's name -> value in SI.

    seconds : time [s]; head, demand : of nodes [m], [m3/s], demand with the flow of emitters
    flow, loss : of links [m3/s], [m]; open : of links, True if the link is not closed
    setting : of valves as in `EpanetLink`, relative speed of pumps
    """

    seconds: float
    head: dict[str, float]
    demand: dict[str, float]
    flow: dict[str, float]
    loss: dict[str, float]
    open: dict[str, bool]
    setting: dict[str, float]


@dataclass(frozen=True)
class EpanetRun:
    """EPANET's solutions at the times of a run.

    warnings : of EPANET's report; unbalanced : number of times without convergence; cpu_time : processor time [s]
    version : of EPANET, "2.2" or "2.3"
    """

    solutions: list[EpanetSolution]
    warnings: list[str]
    unbalanced: int
    cpu_time: float
    version: str


def is_installed() -> bool:
    """True if EPANET's toolkit is installed."""
    return importlib.util.find_spec("epanet") is not None


def read_network(path: Path, required_pressure: float = 0.0) -> EpanetNetwork:
    """Read an EPANET file by EPANET's toolkit.

    required_pressure : head of water [m] from which demands are full; below it they depend on pressure, as EPANET's
    PDA with exponent 0.5. With 0 the demands are those of the file.
    Raises FvsolveError with the faults that EPANET finds, each with its line in the file.
    """
    reply = toolkit_reply(path, {"contents": True})
    table = reply["contents"]
    nodes = {entry["name"]: EpanetNode(**entry) for entry in table["nodes"]}
    links = {entry["name"]: EpanetLink(**entry) for entry in table["links"]}
    if required_pressure:
        table["options"] |= {
            "pressure_driven": True,
            "minimum_pressure": 0.0,
            "required_pressure": required_pressure,
            "pressure_exponent": 0.5,
        }
    return EpanetNetwork(
        path,
        title=[readable(line) for line in table["title"]],
        units=table["units"],
        options=table["options"],
        times=table["times"],
        nodes=nodes,
        links=links,
        patterns=[(entry["name"], entry["values"]) for entry in table["patterns"]],
        controls=table["controls"],
        rules=table["rules"],
        rewritten=reply.get("rewritten", []),
        required_pressure=required_pressure,
    )


def library_2_2() -> str | None:
    """File of EPANET 2.2's library in the package WNTR, which is not imported; None if it is missing."""
    try:
        folder = wntr_folder() / "epanet" / "libepanet"
    except FvsolveError:
        return None
    machine = LIBRARY_FOLDERS.get((sys.platform, platform.machine().lower()), "unknown")
    files = [*(folder / machine).glob("*epanet22.*"), *(folder / machine).glob("*epanet2.*")]
    return str(files[0]) if files else None


def wntr_folder() -> Path:
    """Folder of the package WNTR. Raises FvsolveError with an installation hint if it is missing."""
    found = importlib.util.find_spec("wntr")
    if found is None or not found.submodule_search_locations:
        raise FvsolveError(
            'the package WNTR is not installed; try `pip install "fvsolve[epanet]"`, or `pip install wntr six`'
        )
    return Path(found.submodule_search_locations[0])


LIBRARY_FOLDERS = {
    ("linux", "x86_64"): "linux-x64",
    ("win32", "amd64"): "windows-x64",
    ("darwin", "x86_64"): "darwin-x64",
    ("darwin", "arm64"): "darwin-arm",
}


def solution_at(network: EpanetNetwork, hour: float) -> EpanetRun:
    """Run EPANET on the file of a network up to an hour, with all controls and rules; its state at that hour.

    Raises FvsolveError if EPANET finds no solution, or has no results at the hour.
    """
    seconds = round(3600.0 * hour)
    return run_epanet(network, seconds, None, [seconds])


def run_epanet(network: EpanetNetwork, end: int, step: int | None, times: list[int]) -> EpanetRun:
    """Run EPANET on the file of a network.

    end : of the run [s]; step : hydraulic step [s], None for that of the file; times : of the solutions [s]
    Raises FvsolveError if EPANET stops before the end.
    """
    request = {"solutions": [{"seconds": end, "step": step, "rows": times}]}
    if network.required_pressure:
        request |= {
            "required_pressure": network.required_pressure,
            "pressure_unit": network.options["pressure_unit"],
        }
    library = library_2_2()
    try:
        reply = toolkit_reply(network.path, request | {"library": library})
        version = "2.2" if library else "2.3"
    except FvsolveError:  # EPANET 2.2 refuses what is new in 2.3
        if library is None:
            raise
        reply, version = toolkit_reply(network.path, request), "2.3"
    result = reply["solutions"][0]
    if "error" in result:
        raise FvsolveError(f"{network.path.name}: EPANET stops: {result['error']}")
    solutions = [
        _solution(network, at, row)
        for at, row in zip(times, result["rows"], strict=True)
        if row is not None
    ]
    if len(solutions) < len(times):
        missing = next(at for at, row in zip(times, result["rows"], strict=True) if row is None)
        text = f"EPANET's run has no results at hour {missing / 3600.0:g}"
        raise FvsolveError(f"{network.path.name}: {text}; try an earlier hour")
    return EpanetRun(solutions, reply["warnings"], result["unbalanced"], result["seconds"], version)


def _solution(network: EpanetNetwork, seconds: int, row: dict[str, list[float]]) -> EpanetSolution:
    """EpanetSolution from lists in the order of nodes and links."""
    nodes, links = network.nodes, network.links
    unit = {"PRV": "pressure", "PSV": "pressure", "PBV": "pressure", "FCV": "flow"}
    factors = {"pressure": network.options["pressure_unit"], "flow": network.options["flow_unit"]}
    setting = {}
    for (name, link), value in zip(links.items(), row["setting"], strict=True):
        setting[name] = value * factors.get(unit.get(link.kind, ""), 1.0)
    return EpanetSolution(
        float(seconds),
        dict(zip(nodes, row["head"], strict=True)),
        dict(zip(nodes, row["demand"], strict=True)),
        dict(zip(links, row["flow"], strict=True)),
        dict(zip(links, row["loss"], strict=True)),
        {name: value > 0.0 for name, value in zip(links, row["status"], strict=True)},
        setting,
    )


def toolkit_reply(path: Path, request: dict[str, Any]) -> dict[str, Any]:
    """Reply of EPANET's toolkit to a request on a file, from a process of its own, see `toolkit_process`.

    Raises FvsolveError for a missing file or toolkit, for faults of the file, and if EPANET crashes or does not end.
    """
    if not is_installed():
        raise FvsolveError(
            "EPANET files are read by EPANET's toolkit, which is not installed; "
            'try `pip install "fvsolve[epanet]"`, or `pip install owa-epanet`'
        )
    if not path.is_file():
        raise FvsolveError(f"{path}: no such file; expected an EPANET network (.inp)")
    if b"\0" in (head := path.read_bytes()[:4096]):
        text = "expected the text file (.inp) that EPANET writes by File > Export > Network"
        raise FvsolveError(f"{path.name} is not a text file, first bytes {head[:8]!r}; {text}")
    command = python_command(
        str(Path(toolkit_process.__file__)), str(path.resolve()), json.dumps(request)
    )
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            timeout=TIME_LIMIT,
            check=False,
            env=python_environment(),
            cwd="/",
        )
    except subprocess.TimeoutExpired:
        text = f"EPANET does not end within {TIME_LIMIT:g} s; expected a network that EPANET itself can run"
        raise FvsolveError(f"{path.name}: {text}") from None
    if done.returncode != 0:
        last = done.stderr.decode("utf-8", "replace").strip().splitlines()
        text = f"EPANET's toolkit stopped with code {done.returncode}" + (
            f" ({last[-1]})" if last else ""
        )
        raise FvsolveError(f"{path.name}: {text}; expected a file that EPANET can open")
    reply = json.loads(done.stdout)
    if reply["faults"]:
        raise FvsolveError(fault_message(path, reply["faults"]))
    return reply


def fault_message(path: Path, reported: list[str]) -> str:
    """Message that lists every fault once, with its line in the file and a remedy; reported : EPANET's own lines"""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    places: dict[str, int] = {}
    for number, line in enumerate(lines, start=1):
        places.setdefault(" ".join(line.split()), number)
    faults = [_fault(path, readable(item), places) for item in dict.fromkeys(reported)]
    head = f"{path.name}: {len(faults)} fault{'' if len(faults) == 1 else 's'}, reported by EPANET"
    if len(faults) >= MOST_FAULTS:
        head += f" (it lists {MOST_FAULTS} faults at most)"
    return "\n".join([head, *(f"  {fault}" for fault in faults)])


MOST_FAULTS = 10


def _fault(path: Path, reported: str, places: dict[str, int]) -> str:
    """Text of a fault; places : line of the file -> its first number"""
    match = re.match(r"Error (\d+): (.*)", reported)
    code, text = (int(match[1]), match[2]) if match else (0, reported)
    place = ""
    for at in range(len(text)):  # the line of the file stands at the end of the text
        if text[at] == " " and (number := places.get(text[at + 1 :])) is not None:
            place, text = f"{path.name}:{number}: ", f"{text[:at].rstrip(':')}: {text[at + 1 :]}"
            break
    remedy = REMEDIES.get(code, "")
    return f"{place}{text}{f'; {remedy}' if remedy else ''}"


def readable(text: str) -> str:
    """Text in which bytes that are not UTF-8 are read as Windows text (code page 1252)."""
    return (
        text.encode("utf-8", "surrogateescape").decode("utf-8")
        if text.isascii()
        else _decoded(text)
    )


def _decoded(text: str) -> str:
    data = text.encode("utf-8", "surrogateescape")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")
