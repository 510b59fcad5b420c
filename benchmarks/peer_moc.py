"""Runs of rthym-moc 0.4.1 (method of characteristics, C++) from values in SI units.

Properties of rthym-moc, for which this module compensates so that none of them counts as its error:
- US units with rounded constants (g 32.2 ft/s2, 1 gpm = 0.002228 ft3/s);
- the wave speed follows from the wall, a = 4860 ft/s / sqrt(1 + K D/(E e)), K = 319 000 psi, and is then changed so
  that the pipe has a whole number of steps;
- step n ends at (n + 1) dt with the demand of n dt, so schedules are passed one step early;
- the friction factor cannot be below 0.001, so lossless pipes run at 1e-6 of the flow (all equations are then linear);
- heads below the vapour pressure are clamped, so the vapour pressure is set far below all pressures.
"""

from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from measure import peer_module

rthym_moc = peer_module("rthym_moc", "rthym-moc")
FOOT = 0.3048
INCH = 0.0254
GPM = (rthym_moc.GPM_TO_CFS if rthym_moc else np.nan) * FOOT**3  # [m3/s]
OUT_OF_REACH = -1e9  # vapour pressure [psi]
FAINT = 1e-6


def wall(wave_speed):
    """Young's modulus [psi] of a wall with e = D that gives a wave speed [m/s]."""
    return 319_000.0 / ((4860.0 * FOOT / wave_speed) ** 2 - 1.0)


def pipe(name, from_, to, length, diameter, wave_speed, flow, roughness=1e6):
    """Pipe of rthym-moc from values in SI units; `roughness` is its Hazen-Williams coefficient."""
    p = rthym_moc.PipeInput()
    p.id, p.from_node, p.to_node = name, from_, to
    p.length, p.diameter, p.flow_gpm = length / FOOT, diameter / INCH, flow / GPM
    p.wall_thickness, p.poissons_ratio, p.youngs_modulus = diameter / INCH, 0.0, wall(wave_speed)
    p.roughness = roughness
    return p


def node(name, kind, head, demand=0.0):
    """Node of rthym-moc from values in SI units."""
    n = rthym_moc.NodeInput()
    n.id, n.type, n.head, n.demand = name, kind, head / FOOT, demand / GPM
    n.elevation = 0.0
    return n


def timed(solver, end, dt, repeats=1, friction=None):
    """Least CPU time [s] of `repeats` runs, and the results of the last run.

    friction : usf_tau [s] and k_bru; steady friction if None
    """
    best = np.inf
    for _ in range(repeats):
        start = process_time()
        results = solver.run(end, dt, OUT_OF_REACH, *(friction or (dt, 0.0)))
        best = min(best, process_time() - start)
    return best, results


def network_solver(network, closure, dt, flows):
    """Solver of the network with its closing gate for steps of dt; `flows`: steady flows of the pipes [m3/s]."""
    solver = rthym_moc.MOCSolver()
    for name in dict.fromkeys(end for p in network.pipes for end in (p.from_, p.to)):
        kind = "PressureBoundary" if name in network.reservoirs else "Junction"
        solver.add_node(
            node(name, kind, network.head, network.flow if name == network.gate else 0.0)
        )
    for p in network.pipes:
        solver.add_pipe(
            pipe(p.name, p.from_, p.to, p.length, p.diameter, p.wave_speed, flows[p.name])
        )
    times = np.arange(int(closure.finish / dt) + 4) * dt
    demand = network.flow * closure.open(times) / GPM
    solver.set_demand_schedule(network.gate, np.column_stack([times - dt, demand]).tolist())
    return solver


def steady_flows(network):
    """Least-norm steady flows of lossless pipes that supply the gate [m3/s]."""
    names = [n for n in dict.fromkeys(e for p in network.pipes for e in (p.from_, p.to))]
    names = [n for n in names if n not in network.reservoirs]
    balance = np.zeros((len(names), len(network.pipes)))
    for k, p in enumerate(network.pipes):
        for end, sign in ((p.from_, -1.0), (p.to, 1.0)):
            if end in names:
                balance[names.index(end), k] += sign
    drawn = np.array([network.flow if n == network.gate else 0.0 for n in names])
    flow = np.linalg.lstsq(balance, drawn, rcond=None)[0]
    return {p.name: q for p, q in zip(network.pipes, flow, strict=True)}


def heads(network, closure, dt, repeats=1):
    """CPU time [s], times [s] and heads [m] at the probes, rescaled to the flow of the network."""
    faint = replace(network, flow=network.flow * FAINT)
    solver = network_solver(faint, closure, dt, steady_flows(faint))
    cpu, results = timed(solver, network.end, dt, repeats)
    found = {
        p: network.head + (np.asarray(results["node_head"][p]) * FOOT - network.head) / FAINT
        for p in network.probes
    }
    return cpu, np.asarray(results["time"]), found


@dataclass
class Trace:
    """Result of a run: CPU time [s], times [s] and head at the gate [m]."""

    cpu: float
    time: np.ndarray
    head: np.ndarray


def hazen_williams(pipe):
    """Hazen-Williams coefficient from which rthym-moc computes the Darcy factor of `pipe` at its flow.

    The slope f v^2/(2 g D) is 10.44 Q^1.852 / (C^1.852 D^4.871) with Q in gpm and D in inches [ft per ft].
    """
    feet = pipe.diameter / FOOT
    speed = pipe.flow / (np.pi / 4 * pipe.diameter**2) / FOOT
    slope = pipe.factor * speed**2 / (2 * rthym_moc.G_FT_S2 * feet)
    return (10.44 / (slope * (pipe.diameter / INCH) ** 4.871)) ** (1 / 1.852) * pipe.flow / GPM


def uniform_pipe(uniform, nodes, steps, repeats=1, friction=None):
    """Result of one pipe with friction and a closing gate: `nodes` reaches, `steps` steps at Courant 1."""
    dt = uniform.length / uniform.wave_speed / nodes
    solver = rthym_moc.MOCSolver()
    solver.add_node(node("lake", "PressureBoundary", uniform.head))
    solver.add_node(node("gate", "Junction", uniform.head, uniform.flow))
    p = pipe(
        "main", "lake", "gate", uniform.length, uniform.diameter, uniform.wave_speed, uniform.flow
    )
    p.roughness = hazen_williams(uniform)
    solver.add_pipe(p)
    shut = [(-dt, uniform.flow / GPM), (uniform.duration - dt, 0.0)]
    solver.set_demand_schedule("gate", shut)
    cpu, results = timed(solver, (steps - 0.5) * dt, dt, repeats, friction)
    return Trace(cpu, np.asarray(results["time"]), np.asarray(results["node_head"]["gate"]) * FOOT)
