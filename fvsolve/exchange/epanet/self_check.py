"""Comparison of an imported case with EPANET's solution of the original file: heads, flows and levels of tanks."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.case import Case
from fvsolve.core.model.build import build
from fvsolve.errors import FvsolveError, listing
from fvsolve.exchange.epanet.importing import Imported
from fvsolve.exchange.epanet.network_file import EpanetNetwork, EpanetSolution, run_epanet
from fvsolve.exchange.epanet.switching import DAY
from fvsolve.exchange.epanet.toolkit_process import NO_HEAD

# differences of heads [m], and of flows over the largest flow [-], that are named
MOST_HEAD, MOST_FLOW = 0.01, 0.01
LEAST_FLOW = 1e-7  # smaller differences of flows are rounding of EPANET's shut links [m3/s]
# height of heads above all sources which no pump has: constant power with hardly any flow [m]
NO_MEANING = 1000.0
CYCLES = 10  # openings of a valve at a full or empty tank over a day that are a cycle
BLOCK_PREFIX = "controls."  # of the names of events of controls
AT_LIMIT = 1e-3  # distance of a level from its limit that EPANET takes for none [m]
# hydraulic steps of EPANET over a day [s]; the second where differences have no other cause
STEP, FINE_STEP = 10, 2
FALLS = 2.5  # ratio of differences at both steps that shows their cause
# time between rows of the day that are compared [s]; not a time at which patterns change
ROWS = 150


@dataclass(frozen=True)
class Compared:
    """Differences of one quantity between the case and EPANET.

    quantity : "heads", "flows" or "levels"; unit : of values
    count : number of compared places; name : EPANET's name of the place with the greatest difference
    ours, epanet : both values there; time : of that row [s], None at the start
    above : names of places with a difference above `limit`, the greatest first
    left_out : reason -> names of places that are not compared
    """

    quantity: str
    unit: str
    count: int
    name: str
    ours: float
    epanet: float
    limit: float
    above: list[str]
    left_out: dict[str, list[str]]
    time: float | None = None

    @property
    def difference(self) -> float:
        """Greatest difference."""
        return abs(self.ours - self.epanet)


@dataclass(frozen=True)
class SelfCheck:
    """Result of a comparison with EPANET.

    compared : quantities; causes : texts of the notes that explain differences; fault : reason why the case has no
    values to compare, or ""
    """

    compared: list[Compared]
    causes: list[str]
    fault: str = ""

    @property
    def agrees(self) -> bool:
        """True if no difference is above its limit, or each has a named cause."""
        return not self.fault and (
            bool(self.causes) or not any(item.above for item in self.compared)
        )

    def lines(self) -> Iterator[str]:
        """Text of the comparison."""
        if self.fault:
            yield f"self-check: the case has no values to compare with EPANET: {self.fault}"
            return
        for item in self.compared:
            at = "" if item.time is None else f" at {item.time / 3600.0:.4g} h"
            worst = f"greatest difference {item.difference:.2g} {item.unit} at {item.name}{at}"
            yield (
                f"self-check: {item.count} {item.quantity}, {worst} ({item.ours:.6g} {item.unit}, EPANET "
                f"{item.epanet:.6g} {item.unit})"
            )
            if item.above:
                cause = (
                    "; ".join(self.causes)
                    or "cause unknown to the importer; please report the file"
                )
                count = f"{len(item.above)} {item.quantity} differ by more than {item.limit:.2g} {item.unit}"
                yield f"self-check: {count}: {listing(item.above)}. Cause: {cause}"
            for reason, names in item.left_out.items():
                yield f"self-check: {len(names)} {item.quantity} are not compared, {reason}: {listing(names)}"


def check_start(imported: Imported, case: Case) -> SelfCheck:
    """Compare heads and flows of a case at its start with EPANET's solution at the imported hour."""
    try:
        checks = build(case).checks
    except FvsolveError as error:
        return SelfCheck([], [], _unsolved(imported, str(error)))
    heads = {name: checks["nodes"][ours]["head"] for name, ours in imported.nodes.items()}
    pipes = checks["pipes"] or {}
    flows = {name: pipes[ours]["flow"] for name, ours in imported.links.items() if ours in pipes}
    solution = imported.solution
    compared = [
        _compared(
            "heads", "m", heads, solution.head, MOST_HEAD, left_out(imported.network, solution)
        )
    ]
    if flows:
        largest = max((abs(value) for value in solution.flow.values()), default=0.0)
        ours, known = (
            {name: 1e3 * flow for name, flow in table.items()} for table in (flows, solution.flow)
        )
        compared.append(
            _compared("flows", "l/s", ours, known, 1e3 * max(MOST_FLOW * largest, LEAST_FLOW), {})
        )
    causes = imported.causes + imported.start_causes
    return SelfCheck(compared, causes + extreme_heads(imported.network, [solution]))


def _unsolved(imported: Imported, text: str) -> str:
    """Reason why a case has no start; where nothing can supply a demand, EPANET states a head of -1e7 m or so."""
    lost = [name for name, head in imported.solution.head.items() if head < NO_HEAD]
    if not lost:
        return text
    lowest = min(imported.solution.head.values())
    return (
        f"{text}\nEPANET has no physical solution either: it states heads down to {lowest:.3g} m, "
        f"at {listing(lost)}"
    )


def _compared(
    quantity: str,
    unit: str,
    ours: dict[str, float],
    known: dict[str, float],
    limit: float,
    skipped: dict[str, list[str]],
    time: float | None = None,
) -> Compared:
    """Comparison of values by EPANET's names."""
    hidden = {name for names in skipped.values() for name in names}
    gaps = {name: abs(value - known[name]) for name, value in ours.items() if name not in hidden}
    order = sorted(gaps, key=gaps.get, reverse=True)
    worst = order[0] if order else next(iter(ours))
    above = [name for name in order if not gaps[name] <= limit]
    return Compared(
        quantity, unit, len(gaps), worst, ours[worst], known[worst], limit, above, skipped, time
    )


def left_out(network: EpanetNetwork, solution: EpanetSolution) -> dict[str, list[str]]:
    """Reason -> junctions whose head has no meaning in EPANET: cut off from every source."""
    reached = network.supplied(
        lambda link: solution.open[link.name] and not _is_stalled(link, solution)
    )
    dead = [name for name in network.nodes if name not in reached]
    return {"since closed links cut them off from every source": dead} if dead else {}


def _is_stalled(link: Any, solution: EpanetSolution) -> bool:
    """True if a pump of constant power has no flow, for which it has no head."""
    return (
        link.kind == "pump" and link.power is not None and abs(solution.flow[link.name]) < STALLED
    )


STALLED = 1e-7  # [m3/s]


def extreme_heads(network: EpanetNetwork, solutions: list[EpanetSolution]) -> list[str]:
    """Cause of differences if a pump of constant power drives heads of EPANET far above all sources; as a list."""
    pumps = [name for name, link in network.links.items() if link.power is not None]
    sources = [name for name, node in network.nodes.items() if node.kind != "junction"]
    above = [
        max(solution.head.values()) - max(solution.head[name] for name in sources)
        for solution in solutions
    ]
    if not pumps or max(above) < NO_MEANING:
        return []
    return [
        f"pumps of constant power ({listing(pumps)}) with hardly any flow: EPANET states heads {max(above):.3g} m "
        "above every source, which have no meaning"
    ]


def uphill_breakers(network: EpanetNetwork, solutions: list[EpanetSolution]) -> list[str]:
    """Cause of differences if the flow through a PBV is negative at some time, against its drop; as a list."""
    breakers = [name for name, link in network.links.items() if link.kind == "PBV"]
    found = [
        name
        for name in breakers
        if min(solution.flow[name] for solution in solutions) < -LEAST_FLOW
    ]
    return (
        [f"PBV raises the head along a negative flow, which a loss cannot do ({listing(found)})"]
        if found
        else []
    )


def feeding_emitters(network: EpanetNetwork, solutions: list[EpanetSolution]) -> list[str]:
    """Cause of differences if emitters above their pressure feed the network in EPANET at some time; as a list."""
    if not network.options["emitter_backflow"]:
        return []
    found = [
        name
        for name, node in network.nodes.items()
        if node.emitter
        and min(solution.head[name] for solution in solutions) < node.elevation - MOST_HEAD
    ]
    return (
        [f"EPANET lets emitters above their pressure feed the network ({listing(found)})"]
        if found
        else []
    )


def cycling_tanks(events: list[dict[str, Any]]) -> list[str]:
    """Cause of differences if valves at full or empty tanks open again and again over a day; as a list."""
    opened = Counter(
        event["name"]
        for event in events
        if "-altitude" in event["name"] and event["what"] == "opens"
    )
    names = sorted(
        {name.split("-altitude")[0] for name, count in opened.items() if count >= CYCLES}
    )
    text = "tanks at their greatest or least level, whose links open and shut in turn, in EPANET at each step"
    return [f"{text}: {listing(names)}"] if names else []


def switches_at_limits(events: list[dict[str, Any]]) -> list[str]:
    """Cause of differences if a control switches as its tank becomes full or empty; as a list.

    EPANET steps to whole seconds, so by rounding the tank has reached the level of the control or not.
    """
    full = {
        event["time"]
        for event in events
        if event["name"].endswith("-altitude") and "tank is" in event["what"]
    }
    found = {
        event["name"]
        for event in events
        if event["name"].startswith(BLOCK_PREFIX) and event["time"] in full
    }
    names = sorted(name.removeprefix(BLOCK_PREFIX) for name in found)
    text = "controls at the greatest or least level of a tank, which EPANET reaches or misses by rounding"
    return [f"{text}: {listing(names)}"] if names else []


def crossed_limits(network: EpanetNetwork, solutions: list[EpanetSolution]) -> list[str]:
    """Cause of differences if an empty tank gives water in EPANET, or a full one takes it; as a list."""
    found = set()
    for solution in solutions:
        for tank in network.tanks():
            level, inflow = solution.head[tank.name] - tank.elevation, solution.demand[tank.name]
            gives = level <= tank.minimum + AT_LIMIT and inflow < -STALLED
            takes = level >= tank.maximum - AT_LIMIT and inflow > STALLED and not tank.overflow
            if gives or takes:
                found.add(tank.name)
    text = "EPANET lets a tank at its least level give water, or one at its greatest level take it"
    return [f"{text}: {listing(sorted(found))}"] if found else []


def check_day(imported: Imported, case: Any) -> SelfCheck:
    """Compare levels, heads and flows of a case over a day with EPANET at steps of `STEP` seconds.

    case : path or table of the case; of a longer run, its first day is compared
    """
    from fvsolve.case import load
    from fvsolve.core.run import run

    network = imported.network
    tanks = [tank.name for tank in network.tanks()]
    pipes = [name for name, link in network.links.items() if link.kind == "pipe"]
    probes = {("levels", name): f"nodes.{imported.nodes[name]}.level" for name in tanks}
    probes |= {("heads", name): f"nodes.{imported.nodes[name]}.head" for name in network.nodes}
    probes |= {("flows", name): f"links.{imported.links[name]}.flow" for name in pipes}
    end = min(DAY, load(case).numerics.end)
    settings = {
        "numerics.end": end,
        "output.probes": list(probes.values()),
        "output.units": {},
        "output.every": ROWS,
    }
    try:
        result = run(load(case, settings), pictures=False)
    except FvsolveError as error:
        return SelfCheck([], [], _unsolved(imported, str(error)))
    if not result.ok:
        return SelfCheck(
            [], imported.causes, f"the run is not ok: {result.summary.get('reason', '')}"
        )
    every = list(range(0, int(end) + 1, ROWS))
    times = every[1::2]
    rows = np.searchsorted(result.t, np.array(times) - 1e-6)
    series = {
        key: np.asarray(result[probe])[rows] * (1e3 if key[0] == "flows" else 1.0)
        for key, probe in probes.items()
    }
    days = run_epanet(network, int(end), STEP, every).solutions[1::2]
    compared = _compared_days(network, series, days, times)
    events = result.summary["events"]
    causes = imported.causes + extreme_heads(network, days) + uphill_breakers(network, days)
    causes = causes + feeding_emitters(network, days)
    # a cycle at a limit keeps the levels
    if not any(item.above for item in compared if item.quantity == "levels"):
        causes = causes + cycling_tanks(events) + crossed_limits(network, days)
    causes = causes + switches_at_limits(events)
    if not causes and any(item.above for item in compared):
        finer = _compared_days(
            network, series, run_epanet(network, int(end), FINE_STEP, every).solutions[1::2], times
        )
        # the first are levels
        if late := late_switches(compared[0].difference, finer[0].difference):
            causes, compared = late, finer
    return SelfCheck(compared, causes)


def late_switches(coarse: float, fine: float) -> list[str]:
    """Cause of differences that fall with EPANET's step; as a list.

    coarse, fine : greatest difference of levels [m] from EPANET with steps of `STEP` and of `FINE_STEP`
    """
    if coarse < FALLS * fine:
        return []
    text = f"EPANET's controls and rules act up to a step late: with steps of {STEP} s the levels differ by"
    return [f"{text} {coarse:.2g} m, with {FINE_STEP} s by {fine:.2g} m"]


def _compared_days(
    network: EpanetNetwork,
    series: dict[tuple[str, str], np.ndarray],
    days: list[EpanetSolution],
    times: list[int],
) -> list[Compared]:
    """Comparisons of levels, heads and flows; series : (quantity, EPANET's name) -> values at the times [s]"""
    bottoms = {tank.name: tank.elevation for tank in network.tanks()}
    known = {
        "levels": lambda solution, name: solution.head[name] - bottoms[name],
        "heads": lambda solution, name: solution.head[name],
        "flows": lambda solution, name: 1e3 * solution.flow[name],
    }
    largest = max(abs(value) for solution in days for value in solution.flow.values()) * 1e3
    limits = {
        "levels": MOST_HEAD,
        "heads": MOST_HEAD,
        "flows": max(MOST_FLOW * largest, 1e3 * LEAST_FLOW),
    }
    hidden = [left_out(network, solution) for solution in days]
    dead = {name for table in hidden for names in table.values() for name in names}
    compared = []
    for quantity in known:
        shown = [
            name
            for of, name in series
            if of == quantity and (quantity != "heads" or name not in dead)
        ]
        if not shown:
            continue
        ours = np.array([series[quantity, name] for name in shown])
        theirs = np.array(
            [[known[quantity](solution, name) for solution in days] for name in shown]
        )
        gaps = np.abs(ours - theirs)
        greatest = gaps.max(axis=1)
        order = np.argsort(-greatest)
        worst = int(order[0])
        at = int(gaps[worst].argmax())
        limit = limits[quantity]
        compared.append(
            Compared(
                quantity,
                "l/s" if quantity == "flows" else "m",
                len(shown),
                shown[worst],
                float(ours[worst, at]),
                float(theirs[worst, at]),
                limit,
                [shown[k] for k in order if greatest[k] > limit],
                {},
                float(times[at]),
            )
        )
    return compared
