"""The only door to WNTR: an EPANET file as WNTR's network, and EPANET's own state at an hour. Knows no case."""

from __future__ import annotations

import logging
import re
import subprocess
import sys
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fvsolve.errors import FvsolveError

ACCURACY, TRIALS = 1e-5, 200  # of EPANET's own iteration; 1e-5 is the least it takes
SHUT = (0, 1, 2)  # statuses of links: a pump beyond its head, shut by a full or empty tank, shut by a control
LISTING = 60.0  # seconds that EPANET gets to list the faults of a file


@dataclass(frozen=True)
class Hour:
    """EPANET's answer at one time of its own run; name -> value, SI.

    head [m], demand and flow [m3/s]; status: EPANET's code, see SHUT; setting: relative speed of pumps; factor: Darcy's
    """

    seconds: float
    head: dict[str, float]
    demand: dict[str, float]
    flow: dict[str, float]
    status: dict[str, int]
    setting: dict[str, float]
    factor: dict[str, float]


def wntr() -> Any:
    """The package; FvsolveError that says what to install where it is not."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import wntr
    except ImportError as error:
        raise FvsolveError(
            f"EPANET files are read by WNTR, which is not installed ({error}); "
            'try `pip install "fvsolve[epanet]"`, or `pip install wntr six`'
        ) from None
    logging.getLogger("wntr").setLevel(logging.CRITICAL)  # what it warns of is said by us, or is no fault
    return wntr


def read_network(path: Path) -> Any:
    """WNTR's network of an EPANET file.

    Raises FvsolveError with what EPANET or WNTR finds wrong with it, its line where they say one.
    """
    package = wntr()
    if not path.is_file():
        raise FvsolveError(f"{path}: no such file; wanted an EPANET network (.inp)")
    found = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found, faults = package.network.WaterNetworkModel(str(path)), []
    except Exception as error:  # WNTR raises whatever its parser stumbles over
        faults = [_innermost(error)]
    listed = _listed(package, path)  # of what WNTR lets pass too, for example a pattern that is nowhere
    if faults or listed:
        raise FvsolveError(_said(path, listed or faults, "EPANET" if listed else "WNTR, which reads it for us,"))
    return found


def state_at(network: Any, hour: float) -> Hour:
    """EPANET's own run of a network up to an hour, with all its controls and rules.

    Raises FvsolveError where EPANET refuses the network or finds no solution.
    """
    package, seconds = wntr(), round(3600.0 * hour)
    options = network.options
    options.hydraulic.accuracy, options.hydraulic.trials = ACCURACY, max(TRIALS, options.hydraulic.trials)
    options.time.duration, options.time.report_start = seconds, 0
    options.time.report_timestep = seconds or options.time.hydraulic_timestep
    options.time.statistic = "NONE"
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        simulator = package.sim.EpanetSimulator(network, reader=package.epanet.io.BinFile(convert_status=False))
        try:
            found = simulator.run_sim(file_prefix=str(Path(folder) / "net"), convergence_error=True)
        except Exception as error:
            report = Path(folder) / "net.rpt"
            said = _complaints(report) or [_innermost(error)]
            raise FvsolveError(_said(Path(network.name), said, "EPANET")) from None
    if seconds not in found.node["head"].index:
        raise FvsolveError(f"{network.name}: EPANET's run holds no hour {hour:g}")
    rows = [
        found.node["head"],
        found.node["demand"],
        *(found.link[key] for key in ("flowrate", "status", "setting", "friction_factor")),
    ]
    return Hour(float(seconds), *({str(k): v for k, v in row.loc[seconds].items()} for row in rows))


def _innermost(error: BaseException) -> str:
    """The fault at the bottom of a chain of exceptions, as a person reads it."""
    chain = [error]
    while chain[-1].__cause__ is not None:
        chain.append(chain[-1].__cause__)
    if isinstance(chain[-1], UnicodeDecodeError):
        found = chain[-1]
        return f"byte {found.object[found.start]:#x} is not UTF-8 text, as EPANET on Windows writes; save it as UTF-8"
    coded = [one for one in chain if "(Error " in str(one)]
    said = str(coded[-1] if coded else chain[-1]).replace("%s", "").replace(" ()", "")
    if said[:1] == said[-1:] and said[:1] in "\"'":
        said = said[1:-1]
    if not coded and isinstance(chain[-1], KeyError):
        said = f"WNTR does not know {said!r}"
    return re.sub(r"\s+", " ", re.sub(r"^\(Error \d+\) ", "", said)).strip()


def _said(path: Path, faults: list[str], who: str) -> str:
    """One message with every fault once."""
    faults = list(dict.fromkeys(faults))
    head = f"{path.name}: {len(faults)} fault{'' if len(faults) == 1 else 's'}, as {who} says"
    return "\n".join([head, *(f"  {fault}" for fault in faults)])


def _listed(package: Any, path: Path) -> list[str]:
    """All faults that EPANET itself lists of a file; by a second process, since broken files can break its library."""
    library = package.epanet.toolkit.ENepanet(version=2.2).ENlib._name
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "net.rpt"
        call = [sys.executable, "-I", "-S", "-c", _OPEN, library, str(path), str(report), str(Path(folder) / "net.bin")]
        try:
            subprocess.run(call, capture_output=True, timeout=LISTING, check=False)
        except (OSError, subprocess.SubprocessError):
            return []
        return _complaints(report)


_OPEN = """
import ctypes, os, sys
engine = ctypes.CDLL(sys.argv[1])
engine.ENopen(*(os.fsencode(name) for name in sys.argv[2:]))
engine.ENclose()
"""


def _complaints(report: Path) -> list[str]:
    """`undefined curve c9 in [PUMPS] section: q r b HEAD c9` of every error in EPANET's report but the closing one."""
    text = report.read_text(encoding="utf-8", errors="replace") if report.is_file() else ""
    found = re.findall(r"^ *Error \d+: (.*(?:\n +\S.*)?)", text, re.MULTILINE)
    said = [re.sub(r"\s+", " ", one).strip() for one in found]
    return [one for one in said if not one.startswith("one or more errors")]
