"""EPANET's toolkit in a process of its own: contents of a network file, and EPANET's solution, as JSON.

A faulty file can crash EPANET's library, so that this module runs as a script: `toolkit_process.py FILE REQUEST`, with
a request as JSON. It imports nothing but the standard library and the toolkit (package `owa-epanet`). EPANET 2.3 reads
all files of 2.2 but solves some networks differently; solutions are those of EPANET 2.2 if its library (package `wntr`)
is installed. All values are
in SI: m, m3/s, W, s; pressures and settings of pressure are heads of water [m].
"""

import contextlib
import json
import os
import re
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

FOOT, INCH, HORSEPOWER = 0.3048, 0.0254, 745.699872
MINUTE, HOUR, DAY = 60.0, 3600.0, 86400.0
CUBIC_FOOT = FOOT**3
GALLON = 3.785411784e-3
IMPERIAL_GALLON = 4.54609e-3
ACRE_FOOT = 43560.0 * FOOT**3
# Units of flow [m3/s]; EPANET's own factors are rounded to four or five digits
FLOW_UNITS = {
    "CFS": CUBIC_FOOT,
    "GPM": GALLON / MINUTE,
    "MGD": 1e6 * GALLON / DAY,
    "IMGD": 1e6 * IMPERIAL_GALLON / DAY,
    "AFD": ACRE_FOOT / DAY,
    "LPS": 1e-3,
    "LPM": 1e-3 / MINUTE,
    "MLD": 1e3 / DAY,
    "CMH": 1.0 / HOUR,
    "CMD": 1.0 / DAY,
    "CMS": 1.0,
}
US_UNITS = ("CFS", "GPM", "MGD", "IMGD", "AFD")
PSI_PER_FOOT, KPA_PER_PSI, BAR_PER_PSI = 0.4333, 6.895, 0.068948  # EPANET's figures for water
ACCURACIES, TRIALS = (1e-6, 1e-5), 500  # of EPANET's iteration
NO_HEAD = -1e4  # heads below this are EPANET's sign of a demand that nothing can supply [m]
MOST_WARNINGS = 200


class FlowUnits:
    """Factors of flow [m3/s] and length [m] from the units of a file to SI."""

    def __init__(self, tk: Any, project: Any) -> None:
        names = {getattr(tk, name): name for name in FLOW_UNITS}
        self.name = names[tk.getflowunits(project)]
        self.us = self.name in US_UNITS
        self.flow = FLOW_UNITS[self.name]
        self.length = FOOT if self.us else 1.0


class Units(FlowUnits):
    """All factors from the units of a file to SI: also diameter [m], pressure to a head of water [m], and power [W]."""

    def __init__(self, tk: Any, project: Any) -> None:
        super().__init__(tk, project)
        self.diameter = INCH if self.us else 1e-3
        self.power = HORSEPOWER  # the toolkit states horsepower for files in metric units too
        per_foot = {
            tk.PSI: PSI_PER_FOOT,
            tk.KPA: KPA_PER_PSI * PSI_PER_FOOT,
            tk.METERS: FOOT,
            tk.BAR: BAR_PER_PSI * PSI_PER_FOOT,
            tk.FEET: 1.0,
        }
        self.pressure = FOOT / per_foot[int(tk.getoption(project, tk.PRESS_UNITS))]


def contents(tk: Any, project: Any) -> dict[str, Any]:
    """Contents of an open network file in SI, as plain lists and dictionaries."""
    unit = Units(tk, project)
    count = {
        key: tk.getcount(project, getattr(tk, key))
        for key in ("NODECOUNT", "LINKCOUNT", "PATCOUNT", "CURVECOUNT", "CONTROLCOUNT", "RULECOUNT")
    }
    return {
        "version": tk.getversion(),
        "title": [line for line in tk.gettitle(project) if line.strip()],
        "units": unit.name,
        "options": _options(tk, project, unit),
        "times": {
            name: tk.gettimeparam(project, getattr(tk, code)) for name, code in TIMES.items()
        },
        "patterns": [_pattern(tk, project, k) for k in range(1, count["PATCOUNT"] + 1)],
        "curves": [_curve(tk, project, k) for k in range(1, count["CURVECOUNT"] + 1)],
        "nodes": [_node(tk, project, k, unit) for k in range(1, count["NODECOUNT"] + 1)],
        "links": [_link(tk, project, k, unit) for k in range(1, count["LINKCOUNT"] + 1)],
        "controls": [_control(tk, project, k, unit) for k in range(1, count["CONTROLCOUNT"] + 1)],
        "rules": [_rule(tk, project, k, unit) for k in range(1, count["RULECOUNT"] + 1)],
    }


TIMES = {
    "duration": "DURATION",
    "hydraulic_step": "HYDSTEP",
    "pattern_step": "PATTERNSTEP",
    "pattern_start": "PATTERNSTART",
    "rule_step": "RULESTEP",
    "start_clock": "STARTTIME",
}


def _options(tk: Any, project: Any, unit: Units) -> dict[str, Any]:
    kind, minimum, required, exponent = tk.getdemandmodel(project)
    option = {
        name: tk.getoption(project, getattr(tk, code))
        for name, code in {
            "formula": "HEADLOSSFORM",
            "gravity": "SP_GRAVITY",
            "viscosity": "SP_VISCOS",
            "multiplier": "DEMANDMULT",
            "emitter_exponent": "EMITEXPON",
            "emitter_backflow": "EMITBACKFLOW",
            "default_pattern": "DEMANDPATTERN",
            "efficiency": "GLOBALEFFIC",
            "price": "GLOBALPRICE",
            "price_pattern": "GLOBALPATTERN",
            "demand_charge": "DEMANDCHARGE",
        }.items()
    }
    quality, _, _, traced = tk.getqualinfo(project)
    return option | {
        "formula": {tk.HW: "H-W", tk.DW: "D-W", tk.CM: "C-M"}[int(option["formula"])],
        "default_pattern": int(option["default_pattern"]),
        "price_pattern": int(option["price_pattern"]),
        "pressure_unit": unit.pressure,
        "flow_unit": unit.flow,
        "pressure_driven": kind == tk.PDA,
        "minimum_pressure": minimum * unit.pressure,
        "required_pressure": required * unit.pressure,
        "pressure_exponent": exponent,
        "quality": {tk.NONE: "none", tk.CHEM: "chemical", tk.AGE: "age", tk.TRACE: "trace"}[
            quality
        ],
        "traced": traced,
    }


def _pattern(tk: Any, project: Any, index: int) -> dict[str, Any]:
    values = [
        tk.getpatternvalue(project, index, k)
        for k in range(1, tk.getpatternlen(project, index) + 1)
    ]
    return {"name": tk.getpatternid(project, index), "values": values}


def _curve(tk: Any, project: Any, index: int) -> dict[str, Any]:
    """Points of a curve in the units of the file: its kind is not always stated."""
    points = [
        tk.getcurvevalue(project, index, k) for k in range(1, tk.getcurvelen(project, index) + 1)
    ]
    return {"name": tk.getcurveid(project, index), "points": points}


def _points(tk: Any, project: Any, curve: int, x: float, y: float) -> list[list[float]] | None:
    """Points of a curve in SI; x, y : factors from the units of the file; None for the index 0"""
    return [[x * p, y * q] for p, q in _curve(tk, project, curve)["points"]] if curve > 0 else None


def _node(tk: Any, project: Any, index: int, unit: Units) -> dict[str, Any]:
    def value(code: str) -> float:
        return tk.getnodevalue(project, index, getattr(tk, code))

    kind = {tk.JUNCTION: "junction", tk.RESERVOIR: "reservoir", tk.TANK: "tank"}[
        tk.getnodetype(project, index)
    ]
    node: dict[str, Any] = {
        "name": tk.getnodeid(project, index),
        "kind": kind,
        "elevation": unit.length * value("ELEVATION"),
        "position": None,
    }
    # the toolkit raises Exception for a node without coordinates
    with contextlib.suppress(Exception):
        node["position"] = list(tk.getcoord(project, index))
    if kind == "junction":
        amounts = range(1, tk.getnumdemands(project, index) + 1)
        node["demands"] = [
            [
                unit.flow * tk.getbasedemand(project, index, k),
                tk.getdemandpattern(project, index, k),
            ]
            for k in amounts
        ]
        exponent = tk.getoption(project, tk.EMITEXPON)
        node["emitter"] = value("EMITTER") * unit.flow / unit.pressure**exponent
    elif kind == "reservoir":
        node["pattern"] = int(value("PATTERN"))
    else:
        curve = int(value("VOLCURVE"))
        node |= {
            "level": unit.length * value("TANKLEVEL"),
            "minimum": unit.length * value("MINLEVEL"),
            "maximum": unit.length * value("MAXLEVEL"),
            "diameter": unit.length * value("TANKDIAM"),
            "volume": _points(tk, project, curve, unit.length, unit.length**3),
            "overflow": bool(value("CANOVERFLOW")),
        }
    return node


VALVES = ("PRV", "PSV", "PBV", "FCV", "TCV", "GPV", "PCV")


def _link(tk: Any, project: Any, index: int, unit: Units) -> dict[str, Any]:
    def value(code: str) -> float:
        return tk.getlinkvalue(project, index, getattr(tk, code))

    code = tk.getlinktype(project, index)
    kinds = {tk.CVPIPE: "pipe", tk.PIPE: "pipe", tk.PUMP: "pump"} | {
        getattr(tk, name): name for name in VALVES
    }
    kind = kinds[code]
    start, end = tk.getlinknodes(project, index)
    link: dict[str, Any] = {
        "name": tk.getlinkid(project, index),
        "kind": kind,
        "start": tk.getnodeid(project, start),
        "end": tk.getnodeid(project, end),
        "status": {0: "closed", 1: "open"}.get(int(value("INITSTATUS")), "active"),
    }
    if kind == "pipe":
        rough = value("ROUGHNESS")
        if int(tk.getoption(project, tk.HEADLOSSFORM)) == tk.DW:
            rough *= 1e-3 * unit.length  # millimetres, or thousandths of a foot
        return link | {
            "length": unit.length * value("LENGTH"),
            "diameter": unit.diameter * value("DIAMETER"),
            "minor_loss": value("MINORLOSS"),
            "roughness": rough,
            "check_valve": code == tk.CVPIPE,
            "leak_area": value("LEAK_AREA"),
        }
    if kind == "pump":
        constant = tk.getpumptype(project, index) == tk.CONST_HP
        head_curve = 0 if constant else tk.getheadcurveindex(project, index)
        return link | {
            "setting": value("INITSETTING"),
            "power": unit.power * value("PUMP_POWER") if constant else None,
            "curve": _points(tk, project, head_curve, unit.flow, unit.length),
            "pattern": int(value("LINKPATTERN")),
            "efficiency_curve": _points(tk, project, int(value("PUMP_ECURVE")), unit.flow, 0.01),
            "price": value("PUMP_ECOST"),
            "price_pattern": int(value("PUMP_EPAT")),
        }
    setting = value("INITSETTING")
    table: dict[str, Any] = {
        "diameter": unit.diameter * value("DIAMETER"),
        "minor_loss": value("MINORLOSS"),
    }
    if kind == "GPV":
        table["curve"] = _points(tk, project, int(value("GPV_CURVE")), unit.flow, unit.length)
    if kind == "PCV":
        table["curve"] = _points(tk, project, int(value("PCV_CURVE")), 0.01, 0.01)
    return link | table | {"setting": setting * _setting_unit(kind, unit)}


def _setting_unit(kind: str, unit: Units) -> float:
    """Factor to SI of the setting of a link."""
    if kind in ("PRV", "PSV", "PBV"):
        return unit.pressure
    return unit.flow if kind == "FCV" else 1.0


def _control(tk: Any, project: Any, index: int, unit: Units) -> dict[str, Any]:
    code, link, setting, node, level = tk.getcontrol(project, index)
    kind = {tk.LOWLEVEL: "below", tk.HILEVEL: "above", tk.TIMER: "time", tk.TIMEOFDAY: "clock"}[
        code
    ]
    valves = {getattr(tk, name): name for name in VALVES}
    link_code = tk.getlinktype(project, link)
    control = {
        "kind": kind,
        "link": tk.getlinkid(project, link),
        "action": _action(tk, link_code, setting, _setting_unit(valves.get(link_code, ""), unit)),
        "level": level,
    }
    if kind in ("below", "above"):
        control["node"] = tk.getnodeid(project, node)
        tank = tk.getnodetype(project, node) != tk.JUNCTION
        control["level"] = level * (unit.length if tank else unit.pressure)
    return control


def set_general_actions(found: dict[str, Any], text: str) -> None:
    """Set the actions of controls on GPVs from the lines of the file: the toolkit states the index of their curves.

    found : result of `contents`; text : of the file
    """
    general = {link["name"] for link in found["links"] if link["kind"] == "GPV"}
    lines: dict[str, list[str]] = {name: [] for name in general}
    section = ""
    for line in text.splitlines():
        words = line.partition(";")[0].split()
        if words and words[0].startswith("["):
            section = words[0].upper()
        elif section.startswith("[CONT") and len(words) > 2 and words[1] in general:
            lines[words[1]].append(words[2].lower())
    for control in found["controls"]:
        if control["link"] in general and lines[control["link"]]:
            word = lines[control["link"]].pop(0)
            control["action"] = [word] if word in ("open", "closed") else control["action"]


def _action(tk: Any, code: int, setting: float, factor: float) -> list[Any]:
    """Action as ["open"], ["closed"] or ["setting", value in SI]; code : kind of link"""
    pipe = code in (tk.PIPE, tk.CVPIPE)
    if setting == tk.SET_CLOSED or (setting == 0.0 and (pipe or code == tk.PUMP)):
        return ["closed"]
    if setting == tk.SET_OPEN or pipe:
        return ["open"]
    return ["setting", setting * factor]


def _rule(tk: Any, project: Any, index: int, unit: Units) -> dict[str, Any]:
    premises, thens, elses, priority = tk.getrule(project, index)

    def actions(get: Any, count: int) -> list[Any]:
        found = []
        for k in range(1, count + 1):
            link, status, setting = get(project, index, k)
            valves = {getattr(tk, name): name for name in VALVES}
            link_code = tk.getlinktype(project, link)
            words = {tk.R_IS_OPEN: ["open"], tk.R_IS_CLOSED: ["closed"]}
            factor = _setting_unit(valves.get(link_code, ""), unit)
            action = words.get(status) or _action(tk, link_code, setting, factor)
            found.append([tk.getlinkid(project, link), action])
        return found

    return {
        "name": tk.getruleID(project, index),
        "premises": [_premise(tk, project, index, k, unit) for k in range(1, premises + 1)],
        "then": actions(tk.getthenaction, thens),
        "else": actions(tk.getelseaction, elses),
        "priority": priority,
    }


def _premise(tk: Any, project: Any, rule: int, index: int, unit: Units) -> dict[str, Any]:
    logic, object_kind, target, variable, relation, status, value = tk.getpremise(
        project, rule, index
    )
    variables = {
        getattr(tk, f"R_{name}"): name.lower()
        for name in (
            "DEMAND",
            "HEAD",
            "GRADE",
            "LEVEL",
            "PRESSURE",
            "FLOW",
            "STATUS",
            "SETTING",
            "POWER",
            "TIME",
            "CLOCKTIME",
            "FILLTIME",
            "DRAINTIME",
        )
    }
    name = variables[variable]
    where, kind = "", ""
    if object_kind == tk.R_NODE:
        where = tk.getnodeid(project, target)
    elif object_kind == tk.R_LINK:
        where = tk.getlinkid(project, target)
        valves = {getattr(tk, name): name for name in VALVES}
        kind = valves.get(tk.getlinktype(project, target), "")
    factor = {
        "demand": unit.flow,
        "flow": unit.flow,
        "head": unit.length,
        "grade": unit.length,
        "level": unit.length,
        "pressure": unit.pressure,
        "setting": _setting_unit(kind, unit),
    }.get(name, 1.0)
    relations = {
        tk.R_EQ: "=",
        tk.R_NE: "<>",
        tk.R_LE: "<=",
        tk.R_GE: ">=",
        tk.R_LT: "<",
        tk.R_GT: ">",
        tk.R_IS: "=",
        tk.R_NOT: "<>",
        tk.R_BELOW: "<",
        tk.R_ABOVE: ">",
    }
    states = {tk.R_IS_OPEN: "open", tk.R_IS_CLOSED: "closed", tk.R_IS_ACTIVE: "active"}
    return {
        "or": logic == 3,
        "object": {tk.R_NODE: "node", tk.R_LINK: "link"}.get(object_kind, "system"),
        "name": where,
        "variable": name,
        "relation": relations[relation],
        "value": states[status] if name == "status" else value * factor,
    }


NODE_VALUES = {"head": "HEAD", "demand": "DEMAND"}
SWITCHED_OFF = (1.0, 2.0)  # EPANET's codes of a link that is closed for a time, or closed
LINK_VALUES = {"flow": "FLOW", "status": "STATUS", "setting": "SETTING", "loss": "HEADLOSS"}


def solution(
    tk: Any, project: Any, seconds: int, step: int | None, rows: list[int]
) -> dict[str, Any]:
    """EPANET's solution at times, with all controls and rules.

    seconds : end of the run [s]; step : hydraulic step [s], None for that of the file
    rows : times of results [s], equally spaced; EPANET ends a hydraulic step at each
    EPANET iterates to `ACCURACIES[0]`. Where it does not converge, or states heads that nothing can have, the best
    result counts of this accuracy, the next of `ACCURACIES`, and the accuracy and trials of the file.
    """
    own = tk.getoption(project, tk.ACCURACY), tk.getoption(project, tk.TRIALS)
    if tk.getoption(project, tk.UNBALANCED) < 0.0:
        tk.setoption(project, tk.UNBALANCED, 10.0)  # go on after a time without convergence
    tk.settimeparam(project, tk.DURATION, seconds)
    if step is not None:
        tk.settimeparam(project, tk.HYDSTEP, step)
        tk.settimeparam(project, tk.RULESTEP, min(step, 360))
    if len(rows) > 1:
        tk.settimeparam(project, tk.REPORTSTART, 0)
        tk.settimeparam(project, tk.REPORTSTEP, rows[1] - rows[0])
    best: dict[str, Any] = {}
    attempts = [*((accuracy, max(TRIALS, own[1])) for accuracy in ACCURACIES), own]
    for accuracy, trials in attempts:
        tk.setoption(project, tk.TRIALS, trials)
        found = _solved(tk, project, accuracy, set(rows))
        lost = sum(min(row["head"]) < NO_HEAD for row in found["rows"].values())
        if not best or found["unbalanced"] + lost < best["faults"]:
            best = found | {"faults": found["unbalanced"] + lost}
        if best["faults"] == 0:
            break
    return best | {"rows": [best["rows"].get(at) for at in rows]}


def _solved(tk: Any, project: Any, accuracy: float, requested: set[int]) -> dict[str, Any]:
    """Values at times, and the number of times at which EPANET does not reach an accuracy."""
    unit = FlowUnits(tk, project)
    nodes, links = tk.getcount(project, tk.NODECOUNT), tk.getcount(project, tk.LINKCOUNT)
    table, unbalanced = {}, 0
    tk.setoption(project, tk.ACCURACY, accuracy)
    tk.openH(project)
    tk.initH(project, 0)
    while True:
        now = tk.runH(project)
        unbalanced += tk.getstatistic(project, tk.RELATIVEERROR) > accuracy
        if now in requested:
            table[now] = _row(tk, project, nodes, links, unit)
        if tk.nextH(project) <= 0:
            break
    tk.closeH(project)
    return {"rows": table, "unbalanced": int(unbalanced)}


def _row(tk: Any, project: Any, nodes: int, links: int, unit: FlowUnits) -> dict[str, list[float]]:
    """Values of all nodes and links at the present time, in SI; settings as in the file."""
    row = {}
    for name, code in NODE_VALUES.items():
        factor = unit.length if name == "head" else unit.flow
        row[name] = [
            factor * tk.getnodevalue(project, k, getattr(tk, code)) for k in range(1, nodes + 1)
        ]
    for name, code in LINK_VALUES.items():
        factor = {"flow": unit.flow, "loss": unit.length}.get(name, 1.0)
        row[name] = [
            factor * tk.getlinkvalue(project, k, getattr(tk, code)) for k in range(1, links + 1)
        ]
    for k in range(1, links + 1):
        # a pump that lacks head counts as closed, but is not switched off
        if tk.getlinktype(project, k) == tk.PUMP:
            row["status"][k - 1] = tk.getlinkvalue(project, k, tk.PUMP_STATE) not in SWITCHED_OFF
    return row


def first_version(text: str) -> str:
    """Text of a file of EPANET 1, which EPANET 2.2 reads, in the form that EPANET 2.3 reads too.

    Pumps `ID node node power`, `... head flow`, or `... head head flow head flow [range]` get curves. EPANET 2.2
    computes the shutoff head of the second form as 1.33334 times the head. A line `MULTIPLY factor` of [DEMANDS]
    becomes an option.
    """
    lines = text.splitlines()
    curves = []
    options = []
    section = ""
    for number, line in enumerate(lines):
        words = line.partition(";")[0].split()
        if words and words[0].startswith("["):
            section = words[0].upper()
        elif section.startswith("[DEMA") and len(words) == 2 and words[0].upper() == "MULTIPLY":
            lines[number] = ""
            options.append(f"DEMAND MULTIPLIER {words[1]}")
        elif (
            section.startswith("[PUMP")
            and len(words) > 3
            and (values := _numbers(words[3:])) is not None
        ):
            lines[number] = _pump_line(words, values, curves)
    end = next(
        (k for k, line in enumerate(lines) if line.strip().upper().startswith("[END")), len(lines)
    )
    added = ["[CURVES]", *curves, "[OPTIONS]", *options]
    return "\n".join([*lines[:end], *added, *lines[end:]]) + "\n"


def _pump_line(words: list[str], values: list[float], curves: list[str]) -> str:
    """Line of a pump with a curve, whose lines are added to `curves`; values : numbers of the line of EPANET 1"""
    pump = " ".join(words[:3])
    if len(values) == 1:
        return f"{pump} POWER {words[3]}"
    if len(values) == 2:
        head, flow = values
        points = [(0.0, 1.33334 * head), (flow, head), (2.0 * flow, 0.0)]
    elif len(values) >= 5:
        points = [(0.0, values[0]), (values[2], values[1]), (values[4], values[3])]
    else:
        return " ".join(words)
    name = f"_pump_{len(curves) + 1}"
    curves += [f"{name} {x!r} {y!r}" for x, y in points]
    return f"{pump} HEAD {name}"


def _numbers(words: list[str]) -> list[float] | None:
    try:
        return [float(word) for word in words]
    except ValueError:
        return None


def report_lines(text: str, word: str) -> list[str]:
    """Messages of EPANET's report that begin with a word, such as "Error 203", each with the line that follows it."""
    matches = re.findall(rf"^ *({word}.*(?:\n +\S.*)?)", text, re.MULTILINE)
    return [re.sub(r"\s+", " ", item).strip() for item in matches]


def opened(tk: Any, path: str, files: tuple[str, str]) -> tuple[Any, list[str]]:
    """Project of an opened file, and the faults that EPANET lists; files : for its report and its results"""
    project = tk.createproject()
    try:
        tk.open(project, path, *files)
    except Exception as error:  # the toolkit raises Exception
        tk.close(project)
        found = report_lines(_read(Path(files[0])), "Error")
        return None, [line for line in found if not line.startswith("Error 200")] or [str(error)]
    # EPANET 2.3 reads a pump of EPANET 1 with its power alone as a pump without law
    if hasattr(tk, "NOCURVE"):
        links = range(1, tk.getcount(project, tk.LINKCOUNT) + 1)
        pumps = [k for k in links if tk.getlinktype(project, k) == tk.PUMP]
        bare = [tk.getlinkid(project, k) for k in pumps if tk.getpumptype(project, k) == tk.NOCURVE]
        if bare:
            tk.close(project)
            return None, [
                f"Error 226: no curve or power of pump {name} in [PUMPS] section" for name in bare
            ]
    return project, []


def toolkit(library: str | None) -> Any:
    """Toolkit of EPANET 2.3, or of EPANET 2.2 by the file of its library; both cannot be in one process."""
    if library is None:
        from epanet import toolkit as module

        return module
    sys.path.append(str(Path(__file__).parent))
    from toolkit_library import Library

    return Library(library)


def answer(path: str, request: dict[str, Any]) -> dict[str, Any]:
    """Result of a request on a file: its contents and solutions, or the faults that EPANET lists.

    request : "contents" True for the contents; "solutions" : list of arguments of `solution`; "library" : file of
    EPANET 2.2's library for the solutions, without it they are those of EPANET 2.3; "required_pressure" : head of water
    [m] at which demands that depend on pressure are full, without it demands are as in the file
    """
    tk = toolkit(request.get("library"))
    result: dict[str, Any] = {"faults": []}
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.txt"
        files = str(report), str(Path(folder) / "results.bin")
        project, faults = opened(tk, path, files)
        if any("in [PUMPS]" in line or "MULTIPLY" in line for line in faults):
            rewritten = Path(folder) / "rewritten.inp"
            text = Path(path).read_bytes().decode("utf-8", "surrogateescape")
            rewritten.write_bytes(first_version(text).encode("utf-8", "surrogateescape"))
            result["rewritten"] = faults
            project, faults = opened(tk, str(rewritten), files)
        if faults:
            return result | {"faults": faults}
        if request.get("required_pressure"):
            pressure = request["required_pressure"] / request["pressure_unit"]
            tk.setdemandmodel(project, tk.PDA, 0.0, pressure, 0.5)
        if request.get("contents"):
            result["contents"] = contents(tk, project)
            set_general_actions(result["contents"], _read(Path(path)))
        result["solutions"] = []
        for requested in request.get("solutions", ()):
            begun = time.process_time()
            try:
                found = solution(tk, project, **requested)
            except Exception as error:
                found = {"error": str(error)}
            result["solutions"].append(found | {"seconds": time.process_time() - begun})
        tk.close(project)
        result["warnings"] = report_lines(_read(report), "WARNING")[:MOST_WARNINGS]
    return result


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""


def main() -> None:
    """Print the answer to the request of the command line as JSON."""
    warnings.simplefilter("ignore")  # the toolkit warns at each time with negative pressures
    output = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # EPANET's library prints some messages
    json_text = json.dumps(answer(sys.argv[1], json.loads(sys.argv[2])))
    with os.fdopen(output, "w", encoding="ascii") as stream:
        stream.write(json_text)


if __name__ == "__main__":
    main()
