"""Table of scalars: amounts as states, values at nodes, balances of a run; bounds of amounts and of depths."""

from array import array
from typing import Any

import numpy as np

from fvsolve.assembly.lowering import rows_in
from fvsolve.case.chainage import pieces_of
from fvsolve.errors import Notice
from fvsolve.kernels import calls
from fvsolve.kernels import dtypes as rec
from fvsolve.model.reaction_tables import reacting
from fvsolve.parts.carried_scalar import molar_factor
from fvsolve.parts.formula import means, samples
from fvsolve.steppers.tableau import METHODS
from fvsolve.units import show

STORES = (rec.TANK, rec.CHAMBER)


def lower_scalars(draft) -> None:
    """Fill the table of scalars; add states for their amounts and schedules for their values."""
    case, pipes, nodes, basins = draft.case, draft.pipe_table, draft.node_table, draft.basin_table
    draft.scalar_table, pipes["heat"] = np.zeros(len(case.scalars), rec.SCALAR), -1
    for row, (name, scalar) in zip(draft.scalar_table, case.scalars.items(), strict=True):
        for key in ("diffusivity", "decay", "ambient", "initial"):
            row[key] = getattr(scalar, key)
        names = [f"{mesh.name}.{name}[{i}]" for mesh in draft.meshes for i in range(mesh.cells)]
        row["y"] = draft.states(names, 1.0)
        row["places"], places = len(draft.integers), []
        for place, node, kind in zip(case.places, case.places.values(), nodes["kind"], strict=True):
            given = node.scalars.get(name)
            if kind in STORES:
                places.append(draft.states([f"{place}.{name}"], 1.0))
            else:
                places.append(-1 if given is None else draft.schedules.add(given))
        draft.integers += places
        row["least"], row["greatest"] = bounds(case, name)
        if scalar.decay > 0.0:
            row["loss"] = sum(draft.scalar_table["losses"])
            row["losses"] = 1 if explicit(case.numerics.method) else draft.size - row["y"] + sum(basins["n"])
        row["wall_masses"] = len(draft.floats)
        draft.floats += [*(draft.fluid.density * pipe["area"] * (case.retardation(link, name) - 1.0)
                           for link, pipe in zip(draft.pipe_names, pipes, strict=True)), 0.0]  # fmt: skip
        basins["lost"] = draft.size - row["y"] + np.cumsum(basins["n"]) - basins["n"]
        if scalar.heat:
            row["specific_heat"], row["zero"] = scalar.specific_heat, scalar.zero
            row["by_cell"] = not explicit(case.numerics.method)
            lower_heat(draft, name, scalar.heat_from or (), row["by_cell"])
            if not scalar.heat_from and not exchanger_names(case):
                text = f"{name}: no part heats or cools the fluid; expected parts in `heat_from`, or a heat-exchanger"
                draft.warnings.append(Notice("start", f"scalars.{name}", text))
    if len(case.scalars):
        pipes["center"] = draft.cells + pipes["cell"]


def reserve_scalars(draft) -> None:
    """Reserve the arrays of scalars and heat exchangers; rows of the ledger: inflow through nodes, decay, heat."""
    scalars, nodes, pipes = len(draft.scalar_table), len(draft.node_table), len(draft.pipe_table)
    exchangers, sizes = len(draft.exchanger_table), draft.sizes
    sizes.ledger("gain", scalars * nodes)
    sizes.ledger("loss", sum(draft.scalar_table["losses"]))
    sizes.ledger("heat", draft.heat_rows + exchangers)
    for name, size in (
        ("value", scalars * nodes), ("edge", 2 * pipes * scalars), ("carried", 2 * pipes * scalars),
        ("scalar_inflow", scalars * nodes), ("exchange", 2 * exchangers),
    ):  # fmt: skip
        sizes.out(name, size)
    if scalars:
        sizes.need_scratch(lambda places: 5 * places + 64)
        sizes.need_scratch(4 * scalars * nodes)


def lower_heat(draft, scalar: str, heat_from: Any, by_cell: bool) -> None:
    """Fill the table of restrictions that heat the fluid, and the rows of pipes in the ledger of heat.

    heat_from : names of parts, or "all"; by_cell : True for a row of the ledger for each cell, else for each pipe
    Adds a fault for a part that dissipates nothing in the fluid.
    """
    case, cut, rows = draft.case, pieces_of(draft.case.raw), []
    owners = {link: name for name, part in [*case.nodes.items(), *case.links.items()] for link in part.inner(name)[1]}
    unused = set() if heat_from == "all" else {*heat_from}
    named = {name: whole for whole in unused for name in cut.get(whole, [whole])}
    devices = {name: (k if calls.hook_of(device.law, "power") is not None else -1, device.dissipates(part))
               for k, (name, part, device) in enumerate(draft.devices)}  # fmt: skip

    def heats(name: str) -> bool:
        unused.discard(named.get(name))
        return heat_from == "all" or name in named

    restrictions = [(link, name) for link, _, lowering in rows_in(case, "valve") for name in lowering.row_names(link)]
    for k, (link, name) in enumerate(restrictions):
        device, dissipates = devices.get(name, (-1, True))
        if dissipates and (heats(owners.get(link, link)) or heats(link)):
            rows.append((k, device))
    draft.heat_source_table = np.array(rows, rec.HEAT_SOURCE)
    count = len(rows)
    for name, row in zip(draft.pipe_names, draft.pipe_table, strict=True):
        if heats(name):
            if case.links[name].friction.model == "unsteady" and not case.law.linear:
                text = f'unsteady friction of {name} heats the fluid under law = "linear" only'
                draft.fault(f"scalars.{scalar}.heat_from", f"{text}; expected quasi-steady friction")
            row["heat"] = count
            count += int(row["cells"]) if by_cell else 1
    draft.heat_rows = count
    for name in sorted(unused):
        text = f"{show(name)} dissipates nothing in the fluid; expected valves, pipes and other parts with losses"
        draft.fault(f"scalars.{scalar}.heat_from", text)


def explicit(method: str) -> bool:
    """True if no step of a method solves equations."""
    return method in METHODS and METHODS[method].explicit


def bounds(case, name: str) -> tuple[float, float]:
    """Least and greatest possible value of a scalar: those in the case, because mixing stays between them.

    A scalar that heat changes has no bounds. A scalar that reactions form has no greatest value, and 0 bounds a scalar
    that they consume.
    """
    if case.scalars[name].heat:
        return -np.inf, np.inf
    least, greatest = stated_range(case, name)
    formed, consumed = (name in reacting(case, side) for side in ("right", "left"))
    return min(least, 0.0) if consumed else least, UNBOUNDED if formed else greatest


def stated_range(case, name: str) -> tuple[float, float]:
    """Least and greatest value of a scalar that a case states."""
    scalar = case.scalars[name]
    values = [scalar.initial] + [scalar.ambient] * (scalar.decay > 0.0)
    patches = [patch for basin in case.meshes for patch in case.nodes[basin].patches.values()]
    for part in [*case.places.values(), *case.links.values(), *patches]:
        given = getattr(part, "scalars", {}).get(name)
        values += np.ravel(getattr(given, "value", given)).tolist() if given is not None else []
    for basin, mesh in case.meshes.items():
        if name in case.nodes[basin].scalars:
            values += means(samples(case.nodes[basin].scalars[name], mesh)).tolist()
    return min(values), max(values)


def scale_scalars(draft) -> None:
    """Set steady masses per length in pipes, and the size of a small deviation of scalar amounts in pipes and nodes."""
    profile, rho = draft.tables.profile, draft.fluid.density
    for k, row in enumerate(draft.pipe_table if len(draft.case.scalars) and draft.case.law.linear else ()):
        strain = (draft.profiles[k] - draft.fluid.pressure) / (rho * row["speed"] ** 2)
        profile[row["center"] + np.arange(row["cells"])] = rho * row["area"] * (1.0 + strain)
    scale = np.array(draft.scale)
    for row, name in zip(draft.scalar_table, draft.case.scalars, strict=True):
        typical = typical_value(draft.case, name)
        for pipe, wall in zip(draft.pipe_table, wall_masses(draft.tables, row), strict=True):
            at = row["y"] + pipe["cell"]
            scale[at : at + pipe["cells"]] = typical * rho * pipe["area"] + typical * wall
        for node, place in zip(draft.node_table, indices_at_nodes(draft, row), strict=True):
            if node["kind"] in STORES:
                scale[place] = typical * max(node["mass"], scale[node["y"]])
    draft.scale = array("d", scale.tobytes())


def typical_value(case, name: str) -> float:
    """Size of the values of a scalar: the greatest magnitude in the case; without any that of scalars that react."""
    own = max(map(abs, stated_range(case, name)))
    if own == 0.0 and name in (names := reacting(case)):
        amounts = [max(map(abs, stated_range(case, other))) * molar_factor(case.scalars[other]) for other in names]
        own = max(amounts) / molar_factor(case.scalars[name])
    return own or 1.0


def indices_at_nodes(draft, row) -> np.ndarray:
    """For each node, the index of the state of a scalar's amount, or of the schedule of its value : int64[nodes].

    It is -1 at a node with neither.
    """
    return np.array(draft.integers[row["places"] : row["places"] + len(draft.node_table)], dtype=int)


def start_amounts(draft, y: np.ndarray) -> None:
    """Write the amounts of all scalars in pipes, tanks and chambers at the start into the state vector y."""
    case, profile = draft.case, draft.tables.profile
    for row, (name, scalar) in zip(draft.scalar_table, case.scalars.items(), strict=True):
        for pipe, mesh, wall in zip(draft.pipe_table, draft.meshes, wall_masses(draft.tables, row), strict=True):
            cells = np.arange(mesh.cells)
            value = case.links[mesh.name].scalars.get(name, scalar.initial)
            y[row["y"] + pipe["cell"] + cells] = value * (profile[pipe["center"] + cells] + wall)
        for node, part, place in zip(draft.node_table, case.places.values(), indices_at_nodes(draft, row), strict=True):
            if node["kind"] in STORES:
                value = part.scalars[name].first if name in part.scalars else scalar.initial
                y[place] = value * node["mass"]


def wall_masses(tables, row) -> np.ndarray:
    """Mass of fluid per length that stores as much of a scalar as the wall of each pipe : float64[pipes], in kg/m.

    row : row of the scalar in the table of scalars
    """
    return tables.floats[row["wall_masses"] :][: len(tables.pipes)]


def amount_indices(model) -> np.ndarray:
    """Indices of the states that are scalar amounts in pipes and nodes : int64[m]."""
    if not len(model.tables.scalars):
        return np.zeros(0, dtype=int)
    count = model.cells + int(np.isin(model.tables.nodes["kind"], STORES).sum())
    return np.concatenate([row["y"] + np.arange(count) for row in model.tables.scalars])


def pipe_values(model, k: int, y: np.ndarray) -> dict[str, np.ndarray]:
    """Values of all scalars in the cells of pipe k : name -> float64[cells]."""
    pipe, values = model.tables.pipes[k], {}
    n, o = int(pipe["cells"]), int(pipe["y"])
    for row, name in zip(model.tables.scalars, model.case.scalars, strict=True):
        base, at = int(pipe["center"]), int(row["y"] + pipe["cell"])
        mass = model.tables.profile[base : base + n] + (y[o : o + n] + y[o + n : o + 2 * n]) / pipe["speed"]
        values[name] = y[at : at + n] / (mass + wall_masses(model.tables, row)[k])
    return values


def node_values(model, i: int, out: np.ndarray) -> dict[str, float]:
    """Values of all scalars at node i : name -> value; out : array that the right-hand side writes."""
    at, nodes = int(model.layout["value"]), len(model.node_names)
    return {name: float(out[at + q * nodes + i]) for q, name in enumerate(model.case.scalars)}


def total_amount(model, q: int, y: np.ndarray) -> float:
    """Amount of scalar q in all pipes, nodes and basins [kg times the unit of the scalar]."""
    pipes, nodes, row = model.tables.pipes, model.tables.nodes, model.tables.scalars[q]
    total = 0.0
    for pipe in pipes:
        at = int(row["y"] + pipe["cell"])
        total += float(np.sum(y[at : at + int(pipe["cells"])])) * pipe["dx"]
    total += sum(float(np.sum(basin.mass_per_depth() * basin.amounts(y)[q])) for basin in model.basins)
    places = model.tables.integers[row["places"] : row["places"] + len(nodes)]
    return total + float(sum(y[place] for place, kind in zip(places, nodes["kind"], strict=True) if kind in STORES))


def wall_amount(model, q: int, y: np.ndarray) -> float:
    """Amount of scalar q in the walls of all pipes [kg times the unit of the scalar]; `total_amount` includes it."""
    name, total = list(model.case.scalars)[q], 0.0
    for k, wall in enumerate(wall_masses(model.tables, model.tables.scalars[q])):
        if wall > 0.0:
            total += wall * model.tables.pipes[k]["dx"] * float(np.sum(pipe_values(model, k, y)[name]))
    return float(total)


def scalar_ledgers(model, y: np.ndarray, ledger: np.ndarray) -> dict[str, dict[str, Any]]:
    """Balance of each scalar in a run : name -> initial, final, inflow, outflow, decayed, remainder [kg x its unit].

    `initial` and `final` are the sums over fluid and walls; if walls store the scalar, `fluid` and `wall` have both.
    Further entries: net inflow (`by_node`), and inflow and outflow (`nodes`), of each node through which it flows; if
    reactions change it, what they form less what they consume (`reacted`). The temperature that heat changes also has
    `heated`, the sum of heat over specific heat, and `heat` [J] by part.
    relative : |remainder| over the greatest of |initial|, |final| and inflow + outflow + |decayed| + |heated| +
    |reacted|
    ledger : float64[2, m]  integrals of positive rates, and of negative rates, of each row of the stepper's ledger
    """
    ledgers, n = {}, len(model.node_names)
    for q, (name, row) in enumerate(zip(model.case.scalars, model.tables.scalars, strict=True)):
        flows = ledger[:, n + q * n : n + (q + 1) * n]
        decay = ledger[:, n * (1 + len(model.case.scalars)) + row["loss"] :]
        decayed = -float(np.sum(decay[:, : row["losses"]]))
        heat = heat_by_part(model, ledger, q)
        heated = sum(heat.values()) / row["specific_heat"] if heat else 0.0
        initial, final = total_amount(model, q, model.start), total_amount(model, q, y)
        formed = formed_amount(model, q, ledger)
        remainder = final - initial - (float(np.sum(flows)) - decayed + heated + formed)
        by_place: dict[str, np.ndarray] = {}
        for place, flow in zip(model.ledger_names, flows.T, strict=True):
            by_place[place] = by_place.get(place, 0.0) + flow
        turnover = float(np.sum(np.abs(flows))) + abs(decayed) + abs(heated) + abs(formed)
        turnover = max(abs(initial), abs(final), turnover)
        in_wall = {key: wall_amount(model, q, state) for key, state in (("initial", model.start), ("final", y))}
        in_fluid = {"initial": initial - in_wall["initial"], "final": final - in_wall["final"]}
        ledgers[name] = {
            "initial": initial, "final": final, "inflow": float(flows[0].sum()),
            "outflow": float(0.0 - flows[1].sum()), "decayed": decayed,
            **({"fluid": in_fluid, "wall": in_wall} if wall_masses(model.tables, row).any() else {}),
            **({"reacted": formed} if name in reacting(model.case) else {}),
            "by_node": {place: float(flow.sum()) for place, flow in by_place.items() if flow.sum() != 0.0},
            "nodes": {place: {"inflow": float(x), "outflow": float(0.0 - y)}
                      for place, (x, y) in by_place.items() if x != 0.0 or y != 0.0},
            **({"heated": float(heated), "heat": heat} if row["specific_heat"] > 0.0 else {}),
            "remainder": remainder, "relative": abs(remainder) / turnover if turnover > 0.0 else 0.0,
        }  # fmt: skip
    return ledgers


def formed_amount(model, q: int, ledger: np.ndarray) -> float:
    """Amount of scalar q that reactions have formed [kg times its unit]; ledger : as for `scalar_ledgers`."""
    tables, formed = model.tables, 0.0
    first = int(model.layout["extent"] - model.layout["supply"])
    for row in tables.reactions:
        members = tables.integers[row["scalars"] : row["scalars"] + row["count"]].tolist()
        if q in members:
            at = first + int(row["extent"])
            change = tables.floats[row["data"] + 3 * members.index(q) + rec.CHANGE]
            formed += change * float(np.sum(ledger[:, at : at + int(row["extents"])]))
    return formed


def heat_by_part(model, ledger: np.ndarray, q: int) -> dict[str, float]:
    """Heat into the fluid in a run from each part [J] by name, and from each heat exchanger (negative if it cools).

    It is empty for a scalar q that heat does not change; ledger : as for `scalar_ledgers`
    """
    tables, scale = model.tables, float(model.tables.scalars[q]["specific_heat"])
    if scale == 0.0:
        return {}
    first, last = (int(model.layout[name] - model.layout["supply"]) for name in ("heat", "extent"))
    rows = scale * ledger[:, first:last].sum(axis=0)
    heat: dict[str, float] = {}
    for row, value in zip(tables.heat_sources, rows, strict=False):
        name = model.valve_names[row["valve"]]
        heat[name] = heat.get(name, 0.0) + float(value)
    for pipe, row in zip(model.pipes, tables.pipes, strict=True):
        if row["heat"] >= 0:
            count = int(row["cells"]) if tables.scalars[q]["by_cell"] else 1
            heat[pipe.name] = float(rows[row["heat"] :][:count].sum())
    exchangers = rows[rows.size - len(tables.exchangers) :]
    return heat | {name: float(value) for name, value in zip(exchanger_names(model.case), exchangers, strict=True)}


def exchanger_names(case) -> list[str]:
    """Names of the heat exchangers of a case, in the order of their table."""
    return [name for name, link in case.links.items() if link.kind == "heat-exchanger"]


NO_STATE = -1
UNBOUNDED = 1e100  # greatest value of a scalar that reactions form


def state_bounds(model) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of states, arguments of `steppers.output_rows.limit_to_bounds` : (at, by).

    at : int64[3 q]  a bounded state, and up to two states that give the amount of which it is a share, else -1
    by : float64[q, 4]  base and gain of this amount, least share, greatest share
    Bounds of depths come first, because depths bound the amounts of scalars.
    """
    rows = [*depths(model)]
    for q, name in enumerate(model.case.scalars):
        if name not in reacting(model.case):  # limits of single amounts would break sums that reactions keep
            rows += scalar_bounds(model, q)
    if not rows:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 4))
    at, by = (np.concatenate(column) for column in zip(*rows, strict=True))
    return at.ravel(), by


def bound_rows(states, first, second, base, gain, least, most) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of `states` : (int64[q, 3], float64[q, 4]), see `state_bounds`; arguments are arrays or numbers.

    A state lies between `least` and `most` times the amount base + gain (y[first] + y[second]).
    """
    at = np.column_stack(np.broadcast_arrays(states, first, second)).astype(np.int64)
    return at, np.column_stack(np.broadcast_arrays(base, gain, least, most, np.zeros(len(at)))[:4])


def depths(model):
    """Yield `bound_rows` that keep depths of water in basin cells at 0 or above, and limit velocities between steps.

    With bed friction, a velocity between two steps lies between those of the steps.
    """
    for basin in model.basins:
        states = int(basin.row["y"]) + np.arange(basin.n)
        if basin.deep:
            yield bound_rows(states, NO_STATE, NO_STATE, basin.at_rest(), 0.0, -1.0, np.inf)
        if basin.fades > 0.0 and basin.row["friction"] != rec.NO_DRAG:
            for k in range(1, len(basin.quantities)):
                yield bound_rows(states + k * basin.n, states, NO_STATE, basin.at_rest(), 1.0, basin.fades, -1.0)


def scalar_bounds(model, q: int):
    """Yield `bound_rows` of the amounts of scalar q: its least and greatest value, times the mass or depth there.

    The mass per length in the cells of a pipe follows from both waves, plus the wall mass. The mass in a tank or
    chamber follows from its state. In a basin it is the depth, or 1 without variable depth (`basin.deep` False).
    """
    row, tables = model.tables.scalars[q], model.tables
    if np.isinf(row["least"]):
        return
    limits = row["least"], row["greatest"]
    for pipe, wall in zip(tables.pipes, wall_masses(tables, row), strict=True):
        n, k = int(pipe["cells"]), np.arange(pipe["cells"])
        states, wave, masses = row["y"] + pipe["cell"] + k, pipe["y"] + k, tables.profile[pipe["center"] + k] + wall
        yield bound_rows(states, wave, wave + n, masses, 1.0 / pipe["speed"], *limits)
    places = tables.integers[row["places"] : row["places"] + len(tables.nodes)]
    for node, place in zip(tables.nodes, places, strict=True):
        if node["kind"] in STORES:
            yield bound_rows([place], node["y"], NO_STATE, node["mass"], 1.0, *limits)
    for basin in model.basins:
        if basin.row["carried"] < 0:
            continue
        states = int(basin.row["carried"]) + q * basin.n + np.arange(basin.n)
        depth = (int(basin.row["y"]) + np.arange(basin.n), basin.at_rest()) if basin.deep else (NO_STATE, 1.0)
        yield bound_rows(states, depth[0], NO_STATE, depth[1], 1.0, *limits)
