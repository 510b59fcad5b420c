"""Water age and shares of water by source over a run of a network without waves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.argument_checks import FUNCTION, TABLE, validated
from fvsolve.case import Case, load
from fvsolve.core.output.result_table import write_csv
from fvsolve.core.run import run
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.studies.outcome import NO_FIELDS, end_if_interrupted
from fvsolve.studies.water_quality.moving_segments import Segments
from fvsolve.units import show

MOST_STEPS = 10**6
AGE = "age"


@dataclass(frozen=True)
class WaterQuality:
    """Water age, and shares of water by source, at all nodes over a run.

    t : float64[n]  middle of each time step [s]; nodes : names
    age : float64[n, nodes]  mean age of the water that passes a node in a step, or of the water of a tank [s]
    trace : source -> float64[n, nodes]  share of its water [-]
    error : greatest remainder of the balance of a carried value, over its contents
    """

    t: np.ndarray
    nodes: tuple[str, ...]
    age: np.ndarray
    trace: dict[str, np.ndarray]
    error: float

    def of(self, node: str, source: str = "") -> np.ndarray:
        """Age at a node [s], or the share of the water of a source there : float64[n]."""
        if node not in self.nodes:
            raise FvsolveError(f"no node named {show(node)}{did_you_mean(node, self.nodes)}")
        return (self.trace[source] if source else self.age)[:, self.nodes.index(node)]

    def plain(self) -> dict[str, Any]:
        """Plain values for JSON."""
        shares = {name: values.tolist() for name, values in self.trace.items()}
        return {
            "t": self.t.tolist(),
            "nodes": list(self.nodes),
            "age": self.age.tolist(),
            "trace": shares,
            "error": self.error,
        }

    def write(self, folder: Path) -> list[Path]:
        """Write age.csv [h], and trace-SOURCE.csv with shares, over the time [h]; returns the paths."""
        paths = []
        for name, values, factor in [
            (AGE, self.age, 3600.0),
            *((f"trace-{k}", v, 1.0) for k, v in self.trace.items()),
        ]:
            unit = " [h]" if name == AGE else ""
            heads = ["t [h]", *(f"{node}{unit}" for node in self.nodes)]
            rows = np.column_stack([self.t / 3600.0, values / factor]).tolist()
            paths.append(write_csv(folder / f"{name}.csv", heads, rows))
        return paths


@declared("study")
@validated(set=TABLE, progress=FUNCTION)
def water_quality(
    case,
    trace: Sequence[str] = (),
    step: float = 60.0,
    set: Mapping[str, Any] | None = None,
    progress: Callable | None = None,
) -> WaterQuality:
    """Run a network of quasi-steady pipes, and carry the age of its water and shares of sources with its flows.

    `case` as for `run`; trace : nodes whose water is traced: reservoirs, tanks or junctions
    step : longest time step of the transport [s]; set : key -> value; progress : called as progress(t, seconds, steps)
    All water has the age 0 at the start; water of reservoirs and inflows always has it. Pipes have plug flow without
    dispersion, junctions and tanks mix at once. Raises CaseError for an invalid case, and FvsolveError for a case with
    other links than those of water networks, an unknown node, and a run that is not ok.
    """
    loaded = load(case, dict(set or {}))
    nodes, links = network_of(loaded)
    for name in trace:
        if name not in nodes:
            raise FvsolveError(
                f"trace {show(name)}: unknown node{did_you_mean(name, nodes)}; expected a node of the case"
            )
    span = loaded.numerics.end - loaded.numerics.start
    if not 0.0 < step <= span or span / step > MOST_STEPS:
        raise FvsolveError(
            f"step = {step} s is out of range; expected up to the time of the run, {span:g} s, and at "
            f"most {MOST_STEPS} steps"
        )
    steps = int(np.ceil(span / step - 1e-9))
    probes = [f"links.{name}.flow" for name in links]
    keys = {"output.probes": probes, "output.every": span / steps, "output.units": {}, **NO_FIELDS}
    result = run(load(loaded, keys), progress=progress)
    end_if_interrupted(result.reason)
    if not result.ok:
        raise FvsolveError(
            f"{loaded.name}: the run is not ok: {result.reason}. Correct the case before its quality"
        )
    times = np.linspace(loaded.numerics.start, loaded.numerics.end, steps + 1)
    # mean flows in each step, from the volume that passed: float64[steps, links]; two rows at a jump
    t, flow = np.asarray(result.t), np.column_stack([result[probe] for probe in probes])
    volume = np.cumsum(0.5 * np.diff(t)[:, None] * (flow[1:] + flow[:-1]), axis=0)
    volume = np.concatenate([np.zeros((1, flow.shape[1])), volume])
    passed = np.column_stack([np.interp(times, t, column) for column in volume.T])
    flows = np.diff(passed, axis=0) / np.diff(times)[:, None]
    return carried(loaded, nodes, links, times, flows, trace)


def network_of(case: Case) -> tuple[list[str], dict[str, Any]]:
    """(names of the nodes, links that carry water by name) of a case; raises FvsolveError for unsuitable parts."""
    links, other = {}, []
    for name, link in case.links.items():
        if tuple(link.ports) == ("from",):
            continue  # a leak or hydrant, whose water leaves
        fits = set(link.joins.values()) == {"hydraulic"} and {"from", "to"} == {*link.ports}
        still = link.kind == "quasi-steady-pipe" or getattr(link, "length", None) is None
        if not (fits and still and "flow" in link.quantities):
            other.append(name)
        links[name] = link
    wrong = [
        name
        for name, node in case.nodes.items()
        if node.kind not in ("junction", "inflow", "reservoir", "tank")
    ]
    if other or wrong:
        raise FvsolveError(
            f"{listing([*other, *wrong])}: not supported; expected a network of junctions, reservoirs, "
            'tanks, valves, pumps and pipes with pipe_model = "quasi-steady"'
        )
    return list(case.nodes), links


def carried(
    case: Case, nodes: list[str], links: dict[str, Any], times, flows, trace: Sequence[str]
) -> WaterQuality:
    """Carry the time of entry of the water and the shares of sources by the mean flows of all steps.

    The age at a time t is t minus the time of entry, which water keeps and mixes like a tracer.
    """
    index = {name: k for k, name in enumerate(nodes)}
    ends = [(index[link.ports["from"]], index[link.ports["to"]]) for link in links.values()]
    pipes = [link if link.kind == "quasi-steady-pipe" else None for link in links.values()]
    volumes = [
        0.0 if pipe is None else np.pi / 4.0 * pipe.diameter**2 * pipe.length for pipe in pipes
    ]
    store = {
        index[name]: tank_volume(node) for name, node in case.nodes.items() if node.kind == "tank"
    }
    source = {index[name] for name, node in case.nodes.items() if node.kind == "reservoir"}
    given = {index[name]: (1 + k, 1.0) for k, name in enumerate(trace)}
    start = np.array([times[0], *[0.0] * len(trace)])
    water = Segments(ends, volumes, store, source, given, start, len(nodes))
    middle = 0.5 * (times[1:] + times[:-1])
    supply = start.copy()
    found = []
    total, begun = np.zeros(start.size), water.contents()
    for t, flow, step in zip(middle, flows, np.diff(times), strict=True):
        supply[0] = t
        entered, left = water.advance(flow, step, supply)
        total += entered - left
        found.append(water.values.copy())
    values, held = np.array(found), water.contents()
    scale = np.abs(held) + np.abs(begun) + np.abs(total)
    error = float(np.max(np.abs(held - begun - total) / np.where(scale > 0.0, scale, 1.0)))
    shares = {name: values[:, :, 1 + k] for k, name in enumerate(trace)}
    return WaterQuality(middle, tuple(nodes), middle[:, None] - values[:, :, 0], shares, error)


def tank_volume(node: Any) -> float:
    """Volume of the water of a tank at the start [m3]."""
    if isinstance(node.area, float):
        return node.area * node.level
    levels = np.unique([0.0, node.level, *node.area.level[node.area.level < node.level]])
    return float(np.trapezoid(np.interp(levels, node.area.level, node.area.area), levels))
