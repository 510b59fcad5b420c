"""EPANET 2.2 over a day with short steps: levels of tanks and switches of links, step by step by its toolkit."""

import ctypes
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

FOOT = 0.3048
DURATION, HYDRAULIC_STEP, RULE_STEP, ACCURACY = 0, 1, 7, 1  # codes of the toolkit
HEAD, ELEVATION, STATUS, FLOW = 10, 0, 11, 8
OPEN = 1
US_UNITS = range(5)  # codes of flow units: CFS, GPM, MGD, IMGD, AFD


class Day(NamedTuple):
    """Times [s], levels of tanks [m] : EPANET's name -> float64[n], and switches (time [s], link, True if it opens)."""

    time: np.ndarray
    levels: dict[str, np.ndarray]
    switches: list[tuple[float, str, bool]]

    def level(self, tank: str, times):
        """Level of a tank [m], linear between steps."""
        return np.interp(times, self.time, self.levels[tank])


def run(path: Path, tanks: list[str], links: list[str], step: int = 2, end: int = 86400) -> Day:
    """Run EPANET on a file with a hydraulic step [s] up to `end` [s]; links : those whose switches are recorded."""
    import wntr

    engine = wntr.epanet.toolkit.ENepanet(version=2.2)
    with tempfile.TemporaryDirectory() as folder:
        engine.ENopen(str(path), *(str(Path(folder) / name) for name in ("net.rpt", "net.bin")))
        engine.ENsettimeparam(DURATION, end)
        engine.ENsettimeparam(HYDRAULIC_STEP, step)
        engine.ENsettimeparam(RULE_STEP, min(step, 360))
        engine.ENlib.EN_setoption(engine._project, ctypes.c_int(ACCURACY), ctypes.c_double(1e-6))
        unit = FOOT if engine.ENgetflowunits() in US_UNITS else 1.0
        nodes = [engine.ENgetnodeindex(name) for name in tanks]
        pipes = [engine.ENgetlinkindex(name) for name in links]
        bottoms = [engine.ENgetnodevalue(node, ELEVATION) for node in nodes]
        engine.ENopenH()
        engine.ENinitH(0)
        times = []
        heads = []
        states = []
        while True:
            times.append(float(engine.ENrunH()))
            heads.append([engine.ENgetnodevalue(node, HEAD) for node in nodes])
            states.append([engine.ENgetlinkvalue(pipe, STATUS) == OPEN for pipe in pipes])
            if engine.ENnextH() <= 0:
                break
        engine.ENcloseH()
        engine.ENclose()
    levels = unit * (np.array(heads) - np.array(bottoms))
    switches = []
    for k, name in enumerate(links):
        own = np.array([state[k] for state in states])
        switches += [
            (times[i + 1], name, bool(own[i + 1])) for i in np.flatnonzero(own[1:] != own[:-1])
        ]
    return Day(np.array(times), dict(zip(tanks, levels.T, strict=True)), sorted(switches))
