"""Energy of a model at the start, above that of the same parts at rest and at ambient pressure."""

from __future__ import annotations

import numpy as np

from fvsolve.kernels import dtypes as rec
from fvsolve.model.lowering import rows_in
from fvsolve.model.model import Model
from fvsolve.model.unsteady_terms import memory_shares
from fvsolve.model.wall_creep import elements


def datum_of(model: Model, port: str | None = None) -> float:
    """Datum of elevations [m]: elevation of the node `port`, or if None of the lowest node.

    Reservoirs given by a head do not count.
    """
    if port is not None:
        return float(model.elevation[port])
    placed = [model.elevation[name] for name, node in model.case.places.items() if getattr(node, "head", None) is None]
    return float(min(placed, default=0.0))


def available_energy(model: Model) -> dict[str, float]:
    """Energy of every part at the start [J], above its energy at rest and at P = 0 : name -> energy.

    P = p - p_ambient + rho g z is the reduced pressure [Pa], z the elevation above the datum in the settings [m]. A
    tank at P = 0 has its surface at the datum, or as near to it as its bottom and rim allow. Bodies and bushings are
    not included; without them the sum over all parts is an upper bound of the energy that the model can release.
    """
    tables, nodes, energies = model.tables, model.tables.nodes, {}
    datum = float(tables.settings[0]["datum"])
    vessels = vessel_energy_function(model)
    for name, row in zip(model.node_names, nodes, strict=True):
        if row["y"] >= 0 and row["kind"] != rec.VESSEL:
            energies[name] = tank_energy_above_datum(model, row) if row["kind"] == rec.TANK else vessels(row)
    for (name, part, device), row in zip(model.devices, tables.devices, strict=True):
        if above := device.above(model, part, row):
            energies[name] = above
    for k, pipe in enumerate(model.pipes):
        energies[pipe.name] = pipe_energy(model, k) + friction_memory_energy(model, k) + creep_energy(model, k)
    for name, row in zip(model.column_names, tables.columns, strict=True):
        energies[name] = 0.5 * row["flow"] ** 2 * row["length"] / (model.case.properties.density * row["area"])
    for name, row in zip(model.mass_names, tables.masses, strict=False):
        if row["y"] >= 0:
            energies[name] = 0.5 * row["velocity"] ** 2 / row["lightness"]
    for basin in model.basins:
        energies[basin.name] = basin.above(basin.deviations(model.start), datum)
    for (name, *_), row in zip(rows_in(model.case, "brace"), tables.braces, strict=True):
        if row["stiffness"] > 0.0:
            energies[name] = 0.5 * row["force"] ** 2 / row["stiffness"]
    for (name, *_), row in zip(rows_in(model.case, "stop"), tables.stops, strict=True):
        energies[name] = 0.5 * row["stiffness"] * min(0.0, row["below"], row["above"]) ** 2
    return {name: float(value) for name, value in energies.items()}


def vessel_energy_function(model: Model):
    """Function of a chamber's NODE row that returns the energy of the chamber at the start, above that at P = 0 [J].

    P is the reduced pressure, as in `available_energy`.
    """
    st, floats = model.tables.settings[0], model.tables.floats
    if model.case.law.linear:
        return lambda row: 0.5 * row["volume"] * potential(model, row) ** 2 / model.case.properties.bulk_modulus
    from fvsolve.kernels.density import density, enthalpy, pressure_of_enthalpy
    from fvsolve.kernels.network_energy import vessel_energy

    def energy(row) -> float:
        ambient, height = float(st["ambient"]), float(row["elevation"] - st["datum"])
        rest = pressure_of_enthalpy(st, floats, enthalpy(st, floats, ambient) - float(st["gravity"]) * height)
        volume = float(row["volume"])
        parts = [vessel_energy(st, floats, row, density(st, floats, float(p)) * volume, volume, float(p))
                 for p in (row["pressure"], rest)]  # fmt: skip
        return parts[0] - parts[1]

    return energy


def potential(model: Model, row) -> float:
    """Reduced pressure P = p - p_ambient + rho g z of a node at the start [Pa], under the density law `linear`."""
    st = model.tables.settings[0]
    height = float(row["elevation"] - st["datum"])
    return float(row["pressure"]) - model.case.ambient_pressure + float(st["rho"] * st["gravity"]) * height


def pipe_energy(model: Model, k: int) -> float:
    """Energy of pipe k at the start [J], above its energy at rest and at the reduced pressure P = 0."""
    row, pipe, st = model.tables.pipes[k], model.pipes[k], model.tables.settings[0]
    if model.case.law.linear:
        p, flow = potential(model, model.tables.nodes[row["from_node"]]), row["flow"] / row["area"]
        q = p - row["drag"] / row["area"] * pipe.length
        square = (p * p + p * q + q * q) / (3.0 * row["speed"] ** 2) + flow * flow
        return float(0.5 * pipe.length * row["area"] / st["rho"] * square)
    from fvsolve.kernels.density import enthalpy, mass_of_pressure, pressure_of_enthalpy, pressure_of_mass, thrust

    floats, profile = model.tables.floats, model.tables.profile
    base, total = enthalpy(st, floats, float(st["ambient"])), 0.0
    for i, z in enumerate(pipe.elevation):
        height, m = float(st["gravity"] * (z - st["datum"])), float(profile[row["center"] + i])
        rest = pressure_of_enthalpy(st, floats, base - height)
        low = mass_of_pressure(st, floats, row, rest)[0]
        p = pressure_of_mass(st, floats, row, m)
        head, least = enthalpy(st, floats, p) - base + height, enthalpy(st, floats, rest) - base + height
        strain_energy = m * head - low * least - (thrust(st, floats, row, p) - thrust(st, floats, row, rest))
        total += float(row["dx"]) * (strain_energy + 0.5 * row["flow"] ** 2 / m)
    return float(total)


def friction_memory_energy(model: Model, k: int) -> float:
    """Energy in the memory states of unsteady friction of pipe k [J], for the flow at the start."""
    row, pipe, st = model.tables.pipes[k], model.pipes[k], model.tables.settings[0]
    share, full, square = float(memory_shares(model.tables.floats, row).sum()), st["rho"] * row["area"], 1.0
    if not model.case.law.linear:  # memory states hold velocities
        square = np.mean((full / model.tables.profile[row["center"] + np.arange(pipe.cells)]) ** 2)
    return float(0.5 * share * square * row["flow"] ** 2 * pipe.length / full)


def creep_energy(model: Model, k: int) -> float:
    """Energy in the creep of the wall of pipe k at the start [J], above that at the reduced pressure P = 0."""
    row = model.tables.pipes[k]
    if row["elements"] == 0:
        return 0.0
    pairs, rest = elements(model.tables.floats, row), pipe_energy(model, k)
    area, rho, length = float(row["area"]), model.case.properties.density, model.pipes[k].length
    if model.case.law.linear:
        elastic = rest - float(0.5 * row["flow"] ** 2 * length / (rho * area))
    else:
        from fvsolve.kernels.density import pressure_of_mass

        st, floats, profile = model.tables.settings[0], model.tables.floats, model.tables.profile
        p = [pressure_of_mass(st, floats, row, float(m)) for m in profile[row["center"] + np.arange(row["cells"])]]
        excess = np.array(p) - st["ambient"] + rho * st["gravity"] * (model.pipes[k].elevation - st["datum"])
        elastic = float(0.5 * row["dx"] * area / rho * np.sum((excess / row["speed"]) ** 2))
    return float(np.sum(pairs[:, 0] / pairs[:, 1])) * elastic


def tank_energy_above_datum(model: Model, row) -> float:
    """Energy of a tank at the start [J], above its energy with the surface at the datum.

    If the bottom or the rim of the tank does not allow this level, the nearest possible level counts.
    """
    from fvsolve.kernels.network_energy import tank_energy
    from fvsolve.kernels.tanks import tank_level

    st, floats = model.tables.settings[0], model.tables.floats
    rho, target = float(row["density"]), float(st["datum"] - row["elevation"])
    low = -float(row["mass"])
    if target <= 0.0:
        return float(-tank_energy(st, floats, row, rho, low))
    added = rho * float(row["area"]) * target + float(row["mass"])
    while tank_level(row, floats, rho, low + added) < target and row["mass"] + low + added < row["full"]:
        added *= 2.0
    high = min(float(row["full"] - row["mass"]), low + added)
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if tank_level(row, floats, rho, middle) < target else (low, middle)
    return float(-tank_energy(st, floats, row, rho, high))
