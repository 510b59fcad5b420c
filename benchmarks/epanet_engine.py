"""EPANET's own toolkit on an original file: heads and flows at hour 0, and heads over a day with steps of 10 s."""

from __future__ import annotations

import ctypes
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order

# package, name of its library
LIBRARIES = {"2.2": ("wntr", "libepanet22.so"), "2.3": ("epanet", "libepanet2.so")}
FOOT, GALLON, IMPERIAL_GALLON, DAY = 0.3048, 3.785411784e-3, 4.54609e-3, 86400.0
FLOW_UNITS = (  # [m3/s], by EPANET's codes: CFS, GPM, MGD, IMGD, AFD, LPS, LPM, MLD, CMH, CMD, CMS
    FOOT**3, GALLON / 60.0, 1e6 * GALLON / DAY, 1e6 * IMPERIAL_GALLON / DAY, 43560.0 * FOOT**3 / DAY,
    1e-3, 1e-3 / 60.0, 1e3 / DAY, 1.0 / 3600.0, 1.0 / DAY, 1.0,
)  # fmt: skip
US_UNITS = range(5)  # codes with lengths in feet
NODES, LINKS = 0, 2  # of EN_getcount
DEMAND, HEAD, MOST_LEVEL, LEAST_LEVEL, OVERFLOWS, ELEVATION, FLOW, STATUS = (
    9,
    10,
    21,
    20,
    26,
    0,
    8,
    11,
)  # of EN_getnodevalue, EN_getlinkvalue
JUNCTION, TANK, PUMP, CONSTANT_POWER = 0, 2, 2, 0  # kinds of nodes, links, pumps
# links that water passes from their first node alone: check valves, pumps, PRV, PSV
DIRECTED = (0, PUMP, 3, 4)
TRIALS, ACCURACY = 0, 1  # of EN_setoption
DURATION, HYDRAULIC_STEP, REPORT_STEP, REPORT_START, RULE_STEP = 0, 1, 5, 6, 7  # of EN_settimeparam
NEW_FLOWS = 10  # EN_initH: no file of results, first guess of flows
# None is that of the file
ACCURACIES, MOST_TRIALS, DAY_ACCURACY = (1e-8, 1e-7, 1e-6, 1e-5, None), 200, 1e-5
WARNINGS = {
    1: "unbalanced",
    2: "unstable",
    3: "disconnected",
    4: "pump beyond its curve",
    5: "valve without effect",
    6: "negative pressures",
}
CUT_OFF, FAR = "demand cut off", "heads beyond 100 km"  # warnings of our own
# warnings without a solution that a network could have
UNSOLVED = ("unbalanced", "unstable", CUT_OFF, FAR)
FARTHEST = 1e5  # greatest head of a network [m]
# flow below which a pump of constant power gives no head to the nodes behind it [m3/s]
STALLED = 1e-6
AT_LIMIT = 1e-3  # distance of a tank's level from its limit that EPANET takes for none [m]
NO_DEMAND = 1e-9  # smaller outflows are rounding [m3/s]


class EpanetError(Exception):
    """Refusal of a file by EPANET, with its messages."""


@dataclass(frozen=True)
class Start:
    """EPANET's solution at hour 0.

    heads, flows : EPANET's name -> [m], [m3/s]; tanks : names; dead : names of nodes without a path of open links to a
    source, whose heads no law determines; warnings : EPANET's; accuracy : of its iteration, None is that of the file
    """

    heads: dict[str, float]
    flows: dict[str, float]
    tanks: list[str]
    dead: list[str]
    warnings: list[str]
    accuracy: float | None


@dataclass(frozen=True)
class Day:
    """EPANET's heads over a day: times float64[n] [s], heads float64[n, nodes] [m], dead bool[n, nodes], CPU time [s].

    dead : as in `Start`; all nodes where EPANET supplies demands without a source, or has heads beyond 100 km
    crossed : tanks that give water at their least level, or take it at their greatest
    end : last time that EPANET reached [s]; steps : number of its solutions; warnings : EPANET's, with their first time
    """

    times: np.ndarray
    heads: np.ndarray
    dead: np.ndarray
    names: list[str]
    tanks: list[str]
    crossed: list[str]
    cpu: float
    end: float
    steps: int
    warnings: dict[str, float]


def library(version: str) -> Path | None:
    """Path of EPANET's library of a version; None if its package is not installed."""
    package, name = LIBRARIES[version]
    found = find_spec(package)
    folders = found.submodule_search_locations if found else None
    return next((path for folder in folders or () for path in Path(folder).rglob(name)), None)


class Project:
    """Network that EPANET has opened: its names, kinds and units, and reads of values."""

    def __init__(self, engine: ctypes.CDLL) -> None:
        self.engine, self.handle = engine, ctypes.c_void_p()
        engine.EN_createproject(ctypes.byref(self.handle))

    def call(self, function: str, *arguments: Any) -> int:
        """Call a function of the toolkit; return its warning code. Raises EpanetError."""
        code = getattr(self.engine, function)(self.handle, *arguments)
        if code >= 100:
            text = ctypes.create_string_buffer(256)
            self.engine.EN_geterror(code, text, 255)
            raise EpanetError(text.value.decode("latin-1"))
        return code

    def integer(self, function: str, *arguments: Any) -> int:
        """Integer that a function of the toolkit writes to its last argument."""
        value = ctypes.c_int()
        self.call(function, *arguments, ctypes.byref(value))
        return value.value

    def name(self, function: str, index: int) -> str:
        """Name of a node or link."""
        text = ctypes.create_string_buffer(64)
        self.call(function, index, text)
        try:
            return text.value.decode("utf-8")
        except UnicodeDecodeError:
            return text.value.decode("latin-1")

    def values(self, function: str, count: int, quantity: int) -> np.ndarray:
        """Values of all nodes or links, in the units of the file."""
        read, value, out = getattr(self.engine, function), ctypes.c_double(), np.empty(count)
        place = ctypes.byref(value)
        for index in range(count):
            read(self.handle, index + 1, quantity, place)
            out[index] = value.value
        return out

    def read(self) -> None:
        """Read names, kinds, ends and units."""
        nodes, links = self.integer("EN_getcount", NODES), self.integer("EN_getcount", LINKS)
        units = self.integer("EN_getflowunits")
        self.foot, self.unit = FOOT if units in US_UNITS else 1.0, FLOW_UNITS[units]
        self.nodes = [self.name("EN_getnodeid", k + 1) for k in range(nodes)]
        self.links = [self.name("EN_getlinkid", k + 1) for k in range(links)]
        self.kinds = np.array([self.integer("EN_getnodetype", k + 1) for k in range(nodes)])
        self.tanks = [
            name for name, kind in zip(self.nodes, self.kinds, strict=True) if kind == TANK
        ]
        self.ends = np.array([self.ends_of(k + 1) for k in range(links)]).reshape(-1, 2) - 1
        kinds = np.array([self.integer("EN_getlinktype", k + 1) for k in range(links)], dtype=int)
        self.directed = np.isin(kinds, DIRECTED)
        pumps = np.flatnonzero(kinds == PUMP).tolist()
        self.constant = [
            k for k in pumps if self.integer("EN_getpumptype", k + 1) == CONSTANT_POWER
        ]

    def ends_of(self, link: int) -> tuple[int, int]:
        """Indices of both nodes of a link, from 1."""
        start, end = ctypes.c_int(), ctypes.c_int()
        self.call("EN_getlinknodes", link, ctypes.byref(start), ctypes.byref(end))
        return start.value, end.value

    def heads(self) -> np.ndarray:
        """Heads of all nodes [m]."""
        return self.foot * self.values("EN_getnodevalue", len(self.nodes), HEAD)

    def demands(self) -> np.ndarray:
        """Outflows of all nodes [m3/s]."""
        return self.unit * self.values("EN_getnodevalue", len(self.nodes), DEMAND)

    def flows(self) -> np.ndarray:
        """Flows of all links [m3/s]."""
        return self.unit * self.values("EN_getlinkvalue", len(self.links), FLOW)

    def dead(self) -> np.ndarray:
        """True at nodes that no water reaches from a reservoir or tank through open links : bool[nodes]."""
        opened = self.values("EN_getlinkvalue", len(self.links), STATUS) != 0.0
        if self.constant:
            opened[self.constant] &= np.abs(self.flows()[self.constant]) > STALLED
        start, end = self.ends[opened].T
        both = ~self.directed[opened]
        count, sources = len(self.nodes), np.flatnonzero(self.kinds != JUNCTION)
        # the last node feeds all sources
        rows = np.concatenate((start, end[both], np.full(sources.size, count)))
        graph = coo_array(
            (np.ones(rows.size), (rows, np.concatenate((end, start[both], sources)))),
            2 * (count + 1,),
        )
        reached = np.zeros(count + 1, dtype=bool)
        reached[breadth_first_order(graph.tocsr(), count, return_predecessors=False)] = True
        return ~reached[:count]

    def limits(self) -> np.ndarray:
        """Heads between which tanks exchange water : float64[2, nodes] [m]; without limit at other nodes."""
        bottoms = self.values("EN_getnodevalue", len(self.nodes), ELEVATION)
        levels = [
            self.values("EN_getnodevalue", len(self.nodes), code)
            for code in (LEAST_LEVEL, MOST_LEVEL)
        ]
        limits = self.foot * (bottoms + levels) + [[AT_LIMIT], [-AT_LIMIT]]
        overflows = self.values("EN_getnodevalue", len(self.nodes), OVERFLOWS) > 0.0
        limits[0, self.kinds != TANK], limits[1, (self.kinds != TANK) | overflows] = -np.inf, np.inf
        return limits

    def absurdities(self, heads: np.ndarray, dead: np.ndarray) -> list[str]:
        """Reasons why heads [m] are not those of a network, from `UNSOLVED`; dead : as from `dead`"""
        cut_off = (np.abs(self.demands()[dead]) > NO_DEMAND).any()
        return [CUT_OFF] * bool(cut_off) + [FAR] * bool(not (np.abs(heads) < FARTHEST).all())

    def option(self, code: int, value: float) -> None:
        """Set an option of the analysis."""
        self.call("EN_setoption", code, ctypes.c_double(value))

    def seconds(self, function: str) -> tuple[int, int]:
        """Call a function that solves or steps; return the time that it writes [s], and its warning code."""
        time = ctypes.c_long()
        code = self.call(function, ctypes.byref(time))
        return time.value, code


@contextmanager
def opened(path: Path, version: str) -> Iterator[Project]:
    """Project of a file. Raises EpanetError with the messages of EPANET's report if it refuses the file."""
    engine = ctypes.CDLL(str(library(version)))
    with tempfile.TemporaryDirectory() as folder:
        report, project = Path(folder) / "net.rpt", Project(engine)
        try:
            project.call("EN_open", os.fsencode(path), os.fsencode(report), b"")
            project.read()
            yield project
        except EpanetError as error:
            engine.EN_close(project.handle)
            text = report.read_text(encoding="latin-1") if report.is_file() else ""
            listed = re.findall(r"^ *Error \d+: (.*(?:\n +\S.*)?)", text, re.MULTILINE)
            listed = [re.sub(r"\s+", " ", item).strip() for item in listed]
            raise EpanetError("; ".join(dict.fromkeys([*listed[:3], str(error)]))) from None
        engine.EN_close(project.handle)
        engine.EN_deleteproject(project.handle)


def start(path: Path, version: str) -> Start:
    """Solve hour 0, with the least accuracy at which EPANET's iteration ends. Raises EpanetError."""
    with opened(path, version) as project:
        project.call("EN_openH")
        for accuracy in ACCURACIES:
            if accuracy is not None:
                project.option(TRIALS, MOST_TRIALS)
                project.option(ACCURACY, accuracy)
            project.call("EN_initH", NEW_FLOWS)
            try:
                _, code = project.seconds("EN_runH")
            except EpanetError:  # EPANET 2.3 may refuse an accuracy that it cannot reach
                if accuracy is None:
                    raise
                continue
            if WARNINGS.get(code) not in UNSOLVED:
                break
        values, alone = project.heads(), project.dead()
        warnings = [WARNINGS.get(code, f"warning {code}")] if code else []
        warnings += project.absurdities(values, alone)
        heads = dict(zip(project.nodes, values.tolist(), strict=True))
        flows = dict(zip(project.links, project.flows().tolist(), strict=True))
        dead = [name for name, here in zip(project.nodes, alone, strict=True) if here]
        return Start(heads, flows, project.tanks, dead, warnings, accuracy)


def day(path: Path, version: str, step: int = 10, rows: int = 150, end: int = 86400) -> Day:
    """Solve a day with a hydraulic step [s]; heads are kept at odd multiples of `rows` [s]. Raises EpanetError.

    CPU time is that of opening and solving, without the reading of values.
    """
    began = process_time()
    with opened(path, version) as project:
        project.option(ACCURACY, DAY_ACCURACY)
        project.option(TRIALS, MOST_TRIALS)
        rule = ctypes.c_long()
        project.call("EN_gettimeparam", RULE_STEP, ctypes.byref(rule))
        times = {DURATION: end, REPORT_START: 0, REPORT_STEP: rows, HYDRAULIC_STEP: step}
        for code, value in (times | {RULE_STEP: min(step, rule.value or step)}).items():
            project.call("EN_settimeparam", code, ctypes.c_long(value))
        project.call("EN_openH")
        project.call("EN_initH", NEW_FLOWS)
        cpu, kept, warnings, steps, now, left = process_time() - began, [], {}, 0, 0, 1
        (least, most), crossed = project.limits(), set()
        while left > 0:
            began = process_time()
            now, code = project.seconds("EN_runH")
            cpu, steps = cpu + process_time() - began, steps + 1
            if code:
                warnings.setdefault(WARNINGS.get(code, f"warning {code}"), float(now))
            if now % (2 * rows) == rows:
                values, alone = project.heads(), project.dead()
                absurd = project.absurdities(values, alone)
                for text in absurd:
                    warnings.setdefault(text, float(now))
                inflow = project.demands()
                crosses = ((values <= least) & (inflow < -STALLED)) | (
                    (values >= most) & (inflow > STALLED)
                )
                crossed |= set(np.flatnonzero(crosses).tolist())
                kept.append((now, values, alone | bool(absurd)))
            began = process_time()
            left, _ = project.seconds("EN_nextH")
            cpu += process_time() - began
        # EPANET stops where it does not converge, unless the file has `UNBALANCED CONTINUE`
        if not kept:
            raise EpanetError(
                f"EPANET stops at {now} s, before the first row of the day: {', '.join(warnings)}"
            )
        columns = [np.array(column) for column in zip(*kept, strict=True)]
        names = [project.nodes[i] for i in sorted(crossed)]
        return Day(*columns, project.nodes, project.tanks, names, cpu, float(now), steps, warnings)
