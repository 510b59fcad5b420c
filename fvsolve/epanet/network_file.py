"""EPANET files, read by WNTR, and EPANET's solution at an hour of its run."""

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

ACCURACY, TRIALS = 1e-5, 200  # of EPANET's iteration; EPANET accepts no accuracy below 1e-5
CLOSED = (0, 1, 2)  # status codes of closed links: pump beyond its head, full or empty tank, closed by a control
LISTING_TIME = 60.0  # time limit for EPANET to list the faults of a file [s]


@dataclass(frozen=True)
class HourState:
    """EPANET's solution at a time of its run; each dictionary is EPANET's name -> value in SI.

    seconds : time [s]; head, demand : of nodes [m], [m3/s]; flow : of links [m3/s]
    status : EPANET's code of a link, see `CLOSED`
    setting : EPANET's setting of a valve, or the relative speed of a pump
    factor : Darcy friction factor of a pipe
    """

    seconds: float
    head: dict[str, float]
    demand: dict[str, float]
    flow: dict[str, float]
    status: dict[str, int]
    setting: dict[str, float]
    factor: dict[str, float]


def wntr() -> Any:
    """Import the package WNTR and return it. Raises FvsolveError with an installation hint if it is missing."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import wntr
    except ImportError as error:
        raise FvsolveError(
            f"EPANET files are read by WNTR, which is not installed ({error}); "
            'try `pip install "fvsolve[epanet]"`, or `pip install wntr six`'
        ) from None
    logging.getLogger("wntr").setLevel(logging.CRITICAL)  # its warnings repeat our messages, or are no faults
    return wntr


def read_network(path: Path) -> Any:
    """Read an EPANET file as a network of WNTR.

    Raises FvsolveError with the faults that EPANET or WNTR finds, with their lines in the file if reported.
    """
    package = wntr()
    if not path.is_file():
        raise FvsolveError(f"{path}: no such file; expected an EPANET network (.inp)")
    network = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            network, faults = package.network.WaterNetworkModel(str(path)), []
    except Exception as error:  # WNTR raises any exception of its parser
        faults = _clock_faults(path) or [_root_cause(error)]
    listed = _listed_faults(package, path)  # also faults that WNTR ignores, for example an undefined pattern
    if faults or listed:
        raise FvsolveError(_fault_message(path, listed or faults, "EPANET" if listed else "WNTR"))
    return network


def state_at(network: Any, hour: float) -> HourState:
    """Run EPANET on a network up to an hour, with all controls and rules; return its state at that hour.

    The options of `network` for accuracy, trials, duration and report are changed.
    Raises FvsolveError if EPANET rejects the network, finds no solution, or has no results at the hour.
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
            results = simulator.run_sim(file_prefix=str(Path(folder) / "net"), convergence_error=True)
        except Exception as error:
            report = Path(folder) / "net.rpt"
            messages = _report_errors(report) or [_root_cause(error)]
            raise FvsolveError(_fault_message(Path(network.name), messages, "EPANET")) from None
    if seconds not in results.node["head"].index:
        raise FvsolveError(f"{network.name}: EPANET's run has no results at hour {hour:g}; try an earlier hour")
    rows = [
        results.node["head"],
        results.node["demand"],
        *(results.link[key] for key in ("flowrate", "status", "setting", "friction_factor")),
    ]
    return HourState(float(seconds), *({str(k): v for k, v in row.loc[seconds].items()} for row in rows))


def _root_cause(error: BaseException) -> str:
    """Text of the innermost exception in a chain of causes, or of the innermost one with an error code of EPANET."""
    chain = [error]
    while chain[-1].__cause__ is not None:
        chain.append(chain[-1].__cause__)
    if isinstance(chain[-1], UnicodeDecodeError):
        cause = chain[-1]
        return (
            f"byte {cause.object[cause.start]:#x} is not UTF-8 text (EPANET on Windows uses another encoding); "
            "convert the file to UTF-8"
        )
    coded = [link for link in chain if "(Error " in str(link)]
    text = str(coded[-1] if coded else chain[-1]).replace("%s", "").replace(" ()", "")
    if text[:1] == text[-1:] and text[:1] in "\"'":
        text = text[1:-1]
    if not coded and isinstance(chain[-1], KeyError):
        text = f"unknown to WNTR: {text!r}"
    return re.sub(r"\s+", " ", re.sub(r"^\(Error \d+\) ", "", text)).strip()


def _clock_faults(path: Path) -> list[str]:
    """Faults of rules with a clock time that WNTR cannot read: an hour without minutes, such as 6 PM."""
    rule, faults = "", []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.partition(";")[0].split()
        rule = words[1] if len(words) > 1 and words[0].upper() == "RULE" else rule
        if rule and (found := re.search(r"\bCLOCKTIME\s+\S+\s+(\d+) *([AP]M)\b", " ".join(words), re.IGNORECASE)):
            hour, half = found.groups()
            faults.append(f'rule {rule}: the time "{hour} {half}" has no minutes; write {hour}:00 {half}')
    return faults


def _fault_message(path: Path, faults: list[str], source: str) -> str:
    """Message that lists every fault once; source : program that reported the faults"""
    hints = {True: "; expected decimal points", False: ""}
    faults = [f"{fault}{hints[bool(re.search(r'[0-9],[0-9]', fault))]}" for fault in dict.fromkeys(faults)]
    head = f"{path.name}: {len(faults)} fault{'' if len(faults) == 1 else 's'}, reported by {source}"
    return "\n".join([head, *(f"  {fault}" for fault in faults)])


def _listed_faults(package: Any, path: Path) -> list[str]:
    """Faults that EPANET lists for a file; empty if EPANET does not run.

    EPANET runs in a second process, because a faulty file can crash its library.
    """
    library = package.epanet.toolkit.ENepanet(version=2.2).ENlib._name
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "net.rpt"
        call = [
            sys.executable, "-I", "-S", "-c", _OPEN_SCRIPT, library, str(path), str(report),
            str(Path(folder) / "net.bin"),
        ]  # fmt: skip
        try:
            subprocess.run(call, capture_output=True, timeout=LISTING_TIME, check=False)
        except (OSError, subprocess.SubprocessError):
            return []
        return _report_errors(report)


_OPEN_SCRIPT = """
import ctypes, os, sys
engine = ctypes.CDLL(sys.argv[1])
engine.ENopen(*(os.fsencode(name) for name in sys.argv[2:]))
engine.ENclose()
"""


def _report_errors(report: Path) -> list[str]:
    """Texts of the errors in EPANET's report, such as `undefined curve c9 in [PUMPS] section: q r b HEAD c9`."""
    text = report.read_text(encoding="utf-8", errors="replace") if report.is_file() else ""
    matches = re.findall(r"^ *Error \d+: (.*(?:\n +\S.*)?)", text, re.MULTILINE)
    messages = [re.sub(r"\s+", " ", item).strip() for item in matches]
    return [item for item in messages if not item.startswith("one or more errors")]
