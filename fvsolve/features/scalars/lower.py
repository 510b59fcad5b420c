"""Table of scalars: amounts as states, values at nodes, sources of heat."""

from array import array
from typing import Any

import numpy as np

from fvsolve.case.chainage import pieces_of
from fvsolve.core.assembly.lowering import rows_in
from fvsolve.core.kernels import calls
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.errors import Notice
from fvsolve.features.scalars.kernels import tables as records
from fvsolve.features.scalars.reactions import reacting
from fvsolve.parts.carried_scalar import molar_factor
from fvsolve.parts.formula import means, samples
from fvsolve.parts.heat import exchanger_names
from fvsolve.parts.network_elements import network_of
from fvsolve.units import show

STORES = (rec.TANK, rec.CHAMBER)
UNBOUNDED = 1e100  # greatest value of a scalar that reactions form


def lower_scalars(draft, own) -> None:
    """Fill the tables of scalars and heat; add states for their amounts and schedules for their values.

    own : the feature, which receives the tables
    """
    case = draft.case
    pipes = draft.pipe_table
    nodes = draft.node_table
    meshed = draft.meshed
    mesh_cells = sum(part.n for part in meshed)
    own.scalars = np.zeros(len(case.scalars), records.SCALAR)
    for row, (name, scalar) in zip(own.scalars, case.scalars.items(), strict=True):
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
            row["loss"] = sum(own.scalars["losses"])
            row["losses"] = (
                1 if explicit(case.numerics.method) else draft.size - row["y"] + mesh_cells
            )
        row["wall_masses"] = len(draft.floats)
        draft.floats += [
            *(
                draft.fluid.density * pipe["area"] * (case.retardation(link, name) - 1.0)
                for link, pipe in zip(draft.pipe_names, pipes, strict=True)
            ),
            0.0,
        ]
        for k, part in enumerate(meshed):
            part.row["lost"] = draft.size - row["y"] + sum(other.n for other in meshed[:k])
        if scalar.heat:
            row["specific_heat"], row["zero"] = scalar.specific_heat, scalar.zero
            if draft.fluid.walther is not None:
                row["walther_a"], row["walther_b"] = draft.fluid.walther
            row["by_cell"] = not explicit(case.numerics.method)
            lower_heat(draft, own, name, scalar.heat_from or (), row["by_cell"])
            if not scalar.heat_from and not exchanger_names(case):
                text = f"{name}: no part heats or cools the fluid; expected parts in `heat_from`, or a heat-exchanger"
                draft.warnings.append(Notice("start", f"scalars.{name}", text))
    if len(case.scalars):
        pipes["center"] = draft.cells + pipes["cell"]


def lower_exchangers(draft, own) -> None:
    """Fill the table of heat exchangers, also from the heat capacities of their thermal nodes in the network."""
    names = exchanger_names(draft.case)
    stores = network_of(draft).stores.values() if names else ()
    capacity = {item.ends[0]: item.value for item in stores if item.thermal}
    own.exchangers = np.zeros(len(names), records.EXCHANGER)
    for name, row in zip(names, own.exchangers, strict=True):
        link = draft.case.links[name]
        row["node"] = draft.node_index[draft.inside(link.from_)]
        row["conductance"] = link.conductance or 0.0
        row["effectiveness"] = link.effectiveness or 0.0
        row["slowness"] = 1.0 / capacity[link.to] if link.to in capacity else 0.0


def reserve_scalars(draft, own) -> None:
    """Reserve the arrays of scalars and heat exchangers; rows of the ledger: inflow through nodes, decay, heat."""
    scalars = len(own.scalars)
    nodes = len(draft.node_table)
    pipes = len(draft.pipe_table)
    exchangers, sizes = len(own.exchangers), draft.sizes
    sizes.ledger("gain", scalars * nodes)
    sizes.ledger("loss", sum(own.scalars["losses"]))
    sizes.ledger("heat", own.heat_rows + exchangers)
    for name, size in (
        ("value", scalars * nodes),
        ("edge", 2 * pipes * scalars),
        ("carried", 2 * pipes * scalars),
        ("scalar_inflow", scalars * nodes),
        ("exchange", 2 * exchangers),
    ):
        sizes.out(name, size)
    if scalars:
        sizes.need_scratch(lambda places: 5 * places + 64)
        sizes.need_scratch(4 * scalars * nodes)


def lower_heat(draft, own, scalar: str, heat_from: Any, by_cell: bool) -> None:
    """Fill the table of restrictions that heat the fluid, and the rows of pipes in the ledger of heat.

    heat_from : names of parts, or "all"; by_cell : True for a row of the ledger for each cell, else for each pipe
    Adds a fault for a part that dissipates nothing in the fluid.
    """
    case = draft.case
    cut = pieces_of(draft.case.raw)
    rows = []
    owners = {
        link: name
        for name, part in [*case.nodes.items(), *case.links.items()]
        for link in part.inner(name)[1]
    }
    unused = set() if heat_from == "all" else {*heat_from}
    named = {name: whole for whole in unused for name in cut.get(whole, [whole])}
    devices = {
        name: (k if calls.hook_of(device.law, "power") is not None else -1, device.dissipates(part))
        for k, (name, part, device) in enumerate(draft.devices)
    }

    def heats(name: str) -> bool:
        unused.discard(named.get(name))
        return heat_from == "all" or name in named

    restrictions = [
        (link, name)
        for link, _, lowering in rows_in(case, "valve")
        for name in lowering.row_names(link)
    ]
    for k, (link, name) in enumerate(restrictions):
        device, dissipates = devices.get(name, (-1, True))
        if dissipates and (heats(owners.get(link, link)) or heats(link)):
            rows.append((k, device))
    own.heat_sources = np.array(rows, records.HEAT_SOURCE)
    if (own.heat_sources["device"] >= 0).any():
        own.device_hooks = "power", "heat"
    count = len(rows)
    for name, row in zip(draft.pipe_names, draft.pipe_table, strict=True):
        if heats(name):
            if case.links[name].friction.model == "unsteady" and not case.law.linear:
                text = f'unsteady friction of {name} heats the fluid under law = "linear" only'
                draft.fault(
                    f"scalars.{scalar}.heat_from", f"{text}; expected quasi-steady friction"
                )
            row["heat"] = count
            count += int(row["cells"]) if by_cell else 1
    own.heat_rows = count
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


def scale_scalars(draft, own) -> None:
    """Set steady masses per length in pipes, and the size of a small deviation of scalar amounts in pipes and nodes."""
    profile, rho = draft.tables.profile, draft.fluid.density
    for k, row in enumerate(
        draft.pipe_table if len(draft.case.scalars) and draft.case.law.linear else ()
    ):
        strain = (draft.profiles[k] - draft.fluid.pressure) / (rho * row["speed"] ** 2)
        profile[row["center"] + np.arange(row["cells"])] = rho * row["area"] * (1.0 + strain)
    scale = np.array(draft.scale)
    for row, name in zip(own.scalars, draft.case.scalars, strict=True):
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
        amounts = [
            max(map(abs, stated_range(case, other))) * molar_factor(case.scalars[other])
            for other in names
        ]
        own = max(amounts) / molar_factor(case.scalars[name])
    return own or 1.0


def indices_at_nodes(draft, row) -> np.ndarray:
    """For each node, the index of the state of a scalar's amount, or of the schedule of its value : int64[nodes].

    It is -1 at a node with neither.
    """
    return np.array(
        draft.integers[row["places"] : row["places"] + len(draft.node_table)], dtype=int
    )


def start_amounts(draft, own, y: np.ndarray) -> None:
    """Write the amounts of all scalars in pipes, tanks and chambers at the start into the state vector y."""
    case, profile = draft.case, draft.tables.profile
    for row, (name, scalar) in zip(own.scalars, case.scalars.items(), strict=True):
        for pipe, mesh, wall in zip(
            draft.pipe_table, draft.meshes, wall_masses(draft.tables, row), strict=True
        ):
            cells = np.arange(mesh.cells)
            value = case.links[mesh.name].scalars.get(name, scalar.initial)
            y[row["y"] + pipe["cell"] + cells] = value * (profile[pipe["center"] + cells] + wall)
        for node, part, place in zip(
            draft.node_table, case.places.values(), indices_at_nodes(draft, row), strict=True
        ):
            if node["kind"] in STORES:
                value = part.scalars[name].first if name in part.scalars else scalar.initial
                y[place] = value * node["mass"]


def wall_masses(tables, row) -> np.ndarray:
    """Mass of fluid per length that stores as much of a scalar as the wall of each pipe : float64[pipes], in kg/m.

    row : row of the scalar in the table of scalars
    """
    return tables.floats[row["wall_masses"] :][: len(tables.pipes)]
