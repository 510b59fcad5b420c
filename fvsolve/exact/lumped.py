"""Exact solutions of lumped systems: a rigid column, tanks that level or oscillate, a mass on springs.

Column between given pressures, with or without a valve in series, only quadratic losses:
(L / A) dM/dt = D - K |M| M: mass flow M [kg/s], length L and area A of the column, drive D (difference of p + rho g z
between the ends) and resistance K. Both are constant on each interval between jumps of the opening of the valve, where
M is tanh, coth, tan, a hyperbola or a straight line in time.

Levelling of two vessels joined by an orifice with the turbulent law: the flow is q = Cd A sqrt(2 d / rho), pressure
drop d, discharge coefficient Cd, area A of the orifice, density rho. It reduces the drop, d' = -k q, with the pressure
per volume k [Pa/m3] of both vessels. So the drop is a parabola in time: sqrt(d) is linear and reaches zero at the time
2 sqrt(d0) / s, s = k Cd A sqrt(2 / rho), d0 the drop at the start (Torricelli 1644). A laminar transition near zero is
left out.

Oscillation of open tanks of constant area joined by a frictionless rigid column, harmonic in time:
M' = (A / L) D, D' = -g (1 / A_from + 1 / A_to) M, with the areas A_from and A_to of the tanks (infinite for a
reservoir).

Mass on linear springs and dampers between frames, under a constant force: m u'' = F - k u - c u', mass m, displacement
u from the start, force F at the start without damping, stiffness k of all springs, damping c of all dampers.
"""

import cmath
import math
from collections.abc import Callable

import numpy as np

from fvsolve.exact.solution import (
    Exact,
    ExactStart,
    Solution,
    constant_from,
    count_faults,
    fault,
    level_faults,
    reservoirs,
    value,
    valve_faults,
)


def column_faults(case):
    """Yield a fault (keys, message) for each difference of a case from one rigid column between constant pressures.

    A valve or orifice in series with the column is allowed.
    """
    columns, valves = columns_and_valves(case)
    yield from count_faults(case, columns, "rigid-column")
    yield from count_faults(case, valves, "valve") if len(valves) > 1 else ()
    for node, part in case.nodes.items():
        given = part.demand if part.kind == "junction" else part.pressure or part.head
        if not constant_from(given, -math.inf) or (part.kind == "junction" and given.first != 0.0):
            yield fault(case, ("nodes", node), "needs constant pressures and no demand")
    held = {node for node, part in case.nodes.items() if part.kind == "reservoir"}
    fixed = set(held)
    fixed |= {
        end for _, part in valves if {part.from_, part.to} & fixed for end in (part.from_, part.to)
    }
    for link, part in columns:
        for end in {part.from_, part.to} - fixed:
            yield fault(
                case, ("links", link), f"needs a reservoir at {end}, or a valve to a reservoir"
            )
        if {part.from_, part.to}.isdisjoint(held):
            yield fault(case, ("links", link), "needs a reservoir at one end or both")
        if (
            part.friction.model not in ("none", "steady", "quasi-steady")
            or part.friction.roughness is not None
        ):
            yield fault(
                case, ("links", link, "friction"), "supports only friction with a Darcy `factor`"
            )
    joined = {end for _, part in columns for end in (part.from_, part.to)}
    for link, part in valves:
        if len(joined & {part.from_, part.to}) != 1:
            yield fault(case, ("links", link), "needs the valve in series with the column")
        if part.opening.kind not in ("constant", "step") or min(part.opening.value) <= 0.0:
            text = "needs an opening that is constant or jumps, and is never 0"
            yield fault(case, ("links", link, "opening"), text)
        yield from valve_faults(case, link)


def columns_and_valves(case) -> tuple[list, list]:
    """(columns of a case, its valves and orifices): two lists of (name, part)."""
    columns = [item for item in case.links.items() if item[1].kind == "rigid-column"]
    return columns, [item for item in case.links.items() if item[1].kind in ("valve", "orifice")]


def column_solution(case, start: ExactStart) -> Solution:
    """Flows [m3/s], and the pressure [Pa] between column and valve, as functions of time."""
    [(name, column)], valves = columns_and_valves(case)
    rho, t0 = case.properties.density, case.numerics.start
    area = 0.25 * math.pi * column.diameter**2
    potential = {
        node: law(t0) + rho * case.gravity * case.elevation(node)
        for node, law in reservoirs(case).items()
    }
    wall = (
        (column.friction.factor or 0.0) * column.length / column.diameter + column.minor_loss
    ) / (2 * rho * area**2)
    valve = valves[0][1] if valves else None
    ends = [column.from_, column.to]
    drive = sum(
        sign * potential[reservoir_beyond(case, end, valve)]
        for sign, end in zip((1.0, -1.0), ends, strict=True)
    )

    def resistance(t):
        if valve is None:
            return 0.0
        return 1.0 / (2.0 * rho * (valve.flow_area() * float(value(valve.opening, t))) ** 2)

    jumps = [] if valve is None else [float(t) for t in valve.opening.time if t > t0]
    pieces, m = [], start.flow[name] * rho
    for begin, end in zip([t0, *jumps], [*jumps, math.inf], strict=True):
        pieces.append((begin, m, wall + resistance(begin), resistance(begin)))
        m = float(
            flow_after(
                m, drive, pieces[-1][2], area / column.length, np.array(min(end, 1e300) - begin)
            )
        )

    def mass_flow(t):
        return _piecewise(
            pieces,
            t,
            lambda s, piece: flow_after(piece[1], drive, piece[2], area / column.length, s),
        )

    def valve_drop(t):  # in the direction of the column
        m = mass_flow(t)
        return _piecewise(pieces, t, lambda s, piece: np.full(s.shape, piece[3])) * m * np.abs(m)

    result = Solution(case, flow={name: lambda t: mass_flow(t) / rho})
    if valve is not None:
        # positive flow directions of valve and column
        same = valve.from_ == column.to or valve.to == column.from_
        result.flow[valves[0][0]] = lambda t: mass_flow(t) / rho * (1.0 if same else -1.0)
        node = valve.from_ if valve.from_ in ends else valve.to
        sign = 1.0 if node == column.to else -1.0
        base = potential[reservoir_beyond(case, node, valve)] - rho * case.gravity * case.elevation(
            node
        )
        result.pressure[node] = lambda t: base + sign * valve_drop(t)
    return result


def reservoir_beyond(case, end: str, valve) -> str:
    """Name of the reservoir at the node `end` of the column, or on the far side of the valve at that node."""
    if case.nodes[end].kind == "reservoir":
        return end
    return valve.to if valve.from_ == end else valve.from_


def _piecewise(pieces, t, law):
    t = np.asarray(t, dtype=float)
    result = np.empty(t.shape)
    index = np.clip(np.searchsorted([piece[0] for piece in pieces], t, side="right") - 1, 0, None)
    for k, piece in enumerate(pieces):
        result[index == k] = law(t[index == k] - piece[0], piece)
    return result


def flow_after(m: float, drive: float, k: float, a: float, t: np.ndarray) -> np.ndarray:
    """Solution M(t) of M' = a (drive - k |M| M) with M(0) = m, at times t."""
    if drive < 0.0 or (drive == 0.0 and m < 0.0):
        return -flow_after(-m, -drive, k, a, t)
    if k == 0.0:
        return m + a * drive * t
    if drive == 0.0:
        return m / (1.0 + a * k * m * t)
    end, rate = math.sqrt(drive / k), a * math.sqrt(drive * k)
    if m < 0.0:  # the flow reverses at a finite time
        turn = math.atan(-m / end) / rate
        back = end * np.tan(rate * (np.minimum(t, turn) - turn))
        return np.where(t < turn, back, end * np.tanh(rate * np.maximum(t - turn, 0.0)))
    if m < end:
        return end * np.tanh(rate * t + math.atanh(m / end))
    return np.full(t.shape, end) if m == end else end / np.tanh(rate * t + math.atanh(end / m))


def vessel_faults(case, since: float):
    """Yield a fault (keys, message) for each node of a case without constant area, or pressure since a time [s]."""
    for node, part in case.nodes.items():
        if part.kind == "tank" and hasattr(part.area, "area"):
            yield fault(case, ("nodes", node, "area"), "needs a constant area")
        if getattr(part, "connection", None) is not None:
            text = "does not support `connection`; remove this key"
            yield fault(case, ("nodes", node, "connection"), text)
        if part.kind == "chamber" and part.initial_pressure is None:
            yield fault(case, ("nodes", node), "needs the key `initial_pressure`")
        if part.kind == "reservoir" and not constant_from(part.pressure or part.head, since):
            yield fault(case, ("nodes", node), "needs a constant pressure or head")


def with_level_faults(faults: Callable, solution: Callable) -> Callable:
    """Function `find_faults` that also yields faults of levels in the solution, if `faults` yields nothing."""

    def find_faults(case):
        found = list(faults(case))
        yield from found
        if not found:
            flows = {
                name: getattr(link, "initial_flow", None) or 0.0
                for name, link in case.links.items()
            }
            yield from level_faults(solution(case, ExactStart({}, flows)))

    return find_faults


def levelling_faults(case):
    """Yield a fault (keys, message) for each difference of a case from two vessels joined by an orifice or valve."""
    yield from count_faults(case, list(case.links), "orifice or valve")
    start = case.numerics.start
    yield from vessel_faults(case, start)
    for link, part in case.links.items():
        if not constant_from(part.opening, start):
            yield fault(case, ("links", link, "opening"), "needs a constant opening")
        yield from valve_faults(case, link)


def levelling_solution(case, start: ExactStart) -> Solution:
    """Pressures [Pa] and levels [m] of the vessels, and flow [m3/s] of the orifice, as functions of time."""
    (link, part), rho, t0 = (
        next(iter(case.links.items())),
        case.properties.density,
        case.numerics.start,
    )
    ends, weight = (part.from_, part.to), rho * case.gravity
    area = part.flow_area() * float(value(part.opening, t0))
    pressures = [initial_pressure(case, node) for node in ends]
    softness = [pressure_per_volume(case, node) for node in ends]  # pressure per volume of inflow
    drop = sum(
        s * (p + weight * case.elevation(n))
        for s, p, n in zip((1, -1), pressures, ends, strict=True)
    )
    slope = sum(softness) * area * np.sqrt(2.0 / rho)

    def left(t):
        return np.maximum(np.sqrt(abs(drop)) - 0.5 * slope * (np.asarray(t, dtype=float) - t0), 0.0)

    def flow(t):
        return np.sign(drop) * area * np.sqrt(2.0 / rho) * left(t)

    def moved(t):  # volume that has left `from`
        return (
            np.sign(drop) * (abs(drop) - left(t) ** 2) / sum(softness)
            if sum(softness)
            else 0.0 * left(t)
        )

    result = Solution(case, flow={link: flow})
    for k, (sign, node) in enumerate(zip((-1.0, 1.0), ends, strict=True)):
        result.pressure[node] = lambda t, k=k, sign=sign: (
            pressures[k] + sign * softness[k] * moved(t)
        )
        if case.nodes[node].kind == "tank":
            tank = case.nodes[node]
            result.level[node] = lambda t, tank=tank, sign=sign: (
                tank.level + sign * moved(t) / tank.area
            )
    return result


def initial_pressure(case, node: str) -> float:
    """Pressure of a node at the start, as stated in the case file [Pa]."""
    part = case.nodes[node]
    if part.kind == "tank":
        return case.ambient_pressure + case.properties.density * case.gravity * part.level
    if part.kind == "chamber":
        return part.initial_pressure
    return float(reservoirs(case)[node](np.float64(case.numerics.start)))


def pressure_per_volume(case, node: str) -> float:
    """Pressure rise of a tank or chamber per volume of inflow [Pa/m3]; 0 for a reservoir."""
    part = case.nodes[node]
    if part.kind == "tank":
        return case.properties.density * case.gravity / part.area
    return case.properties.bulk_modulus / part.volume if part.kind == "chamber" else 0.0


def oscillation_faults(case):
    """Yield a fault (keys, message) for each difference of a case from open tanks and a frictionless column."""
    yield from count_faults(case, list(case.links), "rigid-column")
    yield from vessel_faults(case, -math.inf)
    if not any(node.kind == "tank" for node in case.nodes.values()):
        yield fault(case, ("nodes",), "needs a tank")
    for link, part in case.links.items():
        if part.friction.model != "none" or part.minor_loss != 0.0:
            text = 'holds only without friction and losses; expected model = "none", and no `minor_loss` of the column'
            yield fault(case, ("links", link, "friction"), text)


def oscillation_solution(case, start: ExactStart) -> Solution:
    """Levels [m] and pressures [Pa] of both end nodes, and flow [m3/s] of the column, as functions of time."""
    name, column = next(iter(case.links.items()))
    rho = case.properties.density
    g = case.gravity
    t0 = case.numerics.start
    slope = 0.25 * math.pi * column.diameter**2 / column.length
    ends = (column.from_, column.to)
    soft = [1.0 / case.nodes[n].area if case.nodes[n].kind == "tank" else 0.0 for n in ends]
    omega = math.sqrt(slope * g * sum(soft))
    first = [initial_pressure(case, node) for node in ends]
    drop = first[0] - first[1] + rho * g * (case.elevation(ends[0]) - case.elevation(ends[1]))
    m0 = start.flow[name] * rho

    def mass_flow(t):
        s = omega * (np.asarray(t, dtype=float) - t0)
        return m0 * np.cos(s) + slope * drop / omega * np.sin(s)

    def moved(t):  # mass that has left `from`
        s = omega * (np.asarray(t, dtype=float) - t0)
        return (m0 * np.sin(s) + slope * drop / omega * (1.0 - np.cos(s))) / omega

    result = Solution(case, flow={name: lambda t: mass_flow(t) / rho})
    for k, (sign, node) in enumerate(zip((-1.0, 1.0), ends, strict=True)):
        result.pressure[node] = lambda t, k=k, sign=sign: first[k] + sign * g * soft[k] * moved(t)
        if case.nodes[node].kind == "tank":
            result.level[node] = lambda t, k=k, sign=sign, node=node: (
                case.nodes[node].level + sign * soft[k] * moved(t) / rho
            )
    return result


def spring_mass_faults(case):
    """Yield a fault (keys, message) for each difference of a case from one mass on springs and dampers."""
    yield from count_faults(
        case, [node for node in case.nodes.values() if node.kind == "mass"], "mass"
    )
    if not any(link.kind == "spring" for link in case.links.values()):
        yield fault(case, ("links",), "needs a spring")
    for name, link in case.links.items():
        if not any(
            end is not None and case.nodes[end].kind == "mass" for end in (link.from_, link.to)
        ):
            yield fault(case, ("links", name), "supports only links that join the mass")
        if link.kind == "force" and not constant_from(link.force, -math.inf):
            yield fault(case, ("links", name, "force"), "needs a constant force")


def spring_mass_solution(case, start: ExactStart) -> Solution:
    """Position [m] and velocity [m/s] of the only mass of a case, as functions of time."""
    name, mass = next(item for item in case.nodes.items() if item[1].kind == "mass")
    at = {
        body: part.initial_position
        for body, part in case.nodes.items()
        if part.domain == "translational"
    }
    stiffness = damping = force = 0.0
    for link in case.links.values():
        sign = 1.0 if link.to == name else -1.0
        if link.kind == "spring":
            stiffness += link.stiffness
            length = at[link.to] - at[link.from_]
            push = (
                link.preload
                if link.preload is not None
                else -link.stiffness * (length - link.free_length)
            )
            force += sign * push
        elif link.kind == "damper":
            damping += link.damping
        else:
            force += sign * link.force.first
    decay = damping / (2.0 * mass.mass)
    v0 = mass.initial_velocity
    t0 = case.numerics.start
    kappa = cmath.sqrt(decay**2 - stiffness / mass.mass)
    end, place = force / stiffness, mass.initial_position
    if case.numerics.initial == "equilibrium":  # the mass then starts at the equilibrium
        place = place + end
        end = 0.0
        force = 0.0

    def parts(t):
        """exp(-decay s) cosh(kappa s) and exp(-decay s) sinh(kappa s) / kappa, with the time s since the start.

        decay = c / (2 m), kappa^2 = decay^2 - k / m, with mass m, stiffness k and damping c
        """
        s = np.asarray(t, dtype=float) - t0
        if abs(kappa) < 1e-12 * math.sqrt(stiffness / mass.mass):
            return np.exp(-decay * s), np.exp(-decay * s) * s
        up, down = np.exp((kappa - decay) * s), np.exp(-(kappa + decay) * s)
        return (0.5 * (up + down)).real, (0.5 * (up - down) / kappa).real

    def position(t):
        c, s = parts(t)
        return place + end * (1.0 - c - decay * s) + v0 * s

    def velocity(t):
        c, s = parts(t)
        return v0 * (c - decay * s) + (force / mass.mass) * s

    return Solution(case, position={name: position}, velocity={name: velocity})


COLUMN = Exact(
    "column",
    ("reservoir", "junction"),
    ("rigid-column", "valve", "orifice"),
    column_faults,
    column_solution,
)
LEVELLING = Exact(
    "levelling",
    ("reservoir", "tank", "chamber"),
    ("valve", "orifice"),
    with_level_faults(levelling_faults, levelling_solution),
    levelling_solution,
)
OSCILLATION = Exact(
    "oscillation",
    ("reservoir", "tank"),
    ("rigid-column",),
    with_level_faults(oscillation_faults, oscillation_solution),
    oscillation_solution,
)
SPRING_MASS = Exact(
    "spring-mass",
    ("mass", "frame", "reservoir"),
    ("spring", "damper", "force"),
    spring_mass_faults,
    spring_mass_solution,
)
