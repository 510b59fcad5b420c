"""Energy accounts of a model: energy ledger, and available energy of its parts."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.core.assembly.lowering import lowering_of, rows_in
from fvsolve.core.assembly.pipe_terms import elements, memory_shares
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.compiled_case import once_per_model
from fvsolve.core.model.model import Model
from fvsolve.core.model.run_data import RunData
from fvsolve.errors import FvsolveError

LEAST_GAS = 1.0  # least gas pressure of a mixture at rest [Pa]


def datum_of(model: Model, port: str | None = None) -> float:
    """Datum of elevations [m]: elevation of the node `port`, or if None of the lowest node.

    Reservoirs given by a head do not count.
    """
    if port is not None:
        return float(model.elevation[port])
    placed = [
        model.elevation[name]
        for name, node in model.case.places.items()
        if getattr(node, "head", None) is None
    ]
    return float(min(placed, default=0.0))


@once_per_model
def available_energy(model: Model) -> dict[str, float]:
    """Energy of every part at the start [J], above its energy at rest and at P = 0 : name -> energy.

    P = p - p_ambient + rho g z is the reduced pressure [Pa], z the elevation above the datum in the settings [m]. A
    tank at P = 0 has its surface at the datum, or as near to it as its bottom and rim allow. Parts that move in space
    are not included; without them the sum over all parts is an upper bound of the energy that the model can release.
    """
    tables = model.tables
    nodes = model.tables.nodes
    energies = {}
    datum = float(tables.settings[0]["datum"])
    vessels = vessel_energy_function(model)
    for name, row in zip(model.node_names, nodes, strict=True):
        if row["y"] >= 0 and row["kind"] != rec.VESSEL:
            energies[name] = (
                tank_energy_above_datum(model, row) if row["kind"] == rec.TANK else vessels(row)
            )
    for (name, part, device), row in zip(model.devices, tables.devices, strict=True):
        if above := device.above(model, part, row):
            energies[name] = above
    for k, pipe in enumerate(model.pipes):
        energies[pipe.name] = (
            pipe_energy(model, k) + friction_memory_energy(model, k) + creep_energy(model, k)
        )
    for name, row in zip(model.column_names, tables.columns, strict=True):
        energies[name] = (
            0.5 * row["flow"] ** 2 * row["length"] / (model.case.properties.density * row["area"])
        )
    for part in model.meshed:
        energies[part.name] = part.above(part.deviations(model.start), datum)
    for feature in model.features:
        energies |= feature.above(model)
    return {name: float(value) for name, value in energies.items()}


def vessel_energy_function(model: Model):
    """Function of a chamber's NODE row that returns the energy of the chamber at the start, above that at P = 0 [J].

    P is the reduced pressure, as in `available_energy`.
    """
    st, floats = model.tables.settings[0], model.tables.floats
    if model.case.law.linear:
        return lambda row: (
            0.5 * row["volume"] * potential(model, row) ** 2 / model.case.properties.bulk_modulus
        )
    from fvsolve.core.kernels.density import density, enthalpy, pressure_of_enthalpy
    from fvsolve.core.kernels.network_energy import vessel_energy

    def energy(row) -> float:
        ambient, height = float(st["ambient"]), float(row["elevation"] - st["datum"])
        rest = reachable(
            st,
            pressure_of_enthalpy(
                st, floats, enthalpy(st, floats, ambient) - st["gravity"] * height
            ),
        )
        volume = float(row["volume"])
        parts = [
            vessel_energy(st, floats, row, density(st, floats, float(p)) * volume, volume, float(p))
            for p in (row["pressure"], rest)
        ]
        return parts[0] - parts[1]

    return energy


def reachable(st, pressure: float) -> float:
    """Pressure at which P = 0 [Pa]; where gas in the fluid would have to expand without bound, that of LEAST_GAS."""
    return float(pressure) if np.isfinite(pressure) else float(st["floor"]) + LEAST_GAS


def potential(model: Model, row) -> float:
    """Reduced pressure P = p - p_ambient + rho g z of a node at the start [Pa], under the density law `linear`."""
    st = model.tables.settings[0]
    height = float(row["elevation"] - st["datum"])
    return (
        float(row["pressure"])
        - model.case.ambient_pressure
        + float(st["rho"] * st["gravity"]) * height
    )


def pipe_energy(model: Model, k: int) -> float:
    """Energy of pipe k at the start [J], above its energy at rest and at the reduced pressure P = 0."""
    row = model.tables.pipes[k]
    pipe = model.pipes[k]
    st = model.tables.settings[0]
    if model.case.law.linear:
        p, flow = potential(model, model.tables.nodes[row["from_node"]]), row["flow"] / row["area"]
        q = p - row["drag"] / row["area"] * pipe.length
        square = (p * p + p * q + q * q) / (3.0 * row["speed"] ** 2) + flow * flow
        return float(0.5 * pipe.length * row["area"] / st["rho"] * square)
    from fvsolve.core.kernels.density import (
        enthalpy,
        mass_of_pressure,
        pressure_of_enthalpy,
        pressure_of_mass,
        thrust,
    )

    floats, profile = model.tables.floats, model.tables.profile
    base, total = enthalpy(st, floats, float(st["ambient"])), 0.0
    for i, z in enumerate(pipe.elevation):
        height, m = float(st["gravity"] * (z - st["datum"])), float(profile[row["center"] + i])
        rest = reachable(st, pressure_of_enthalpy(st, floats, base - height))
        low = mass_of_pressure(st, floats, row, rest)[0]
        p = pressure_of_mass(st, floats, row, m)
        head = enthalpy(st, floats, p) - base + height
        least = enthalpy(st, floats, rest) - base + height
        strain_energy = (
            m * head - low * least - (thrust(st, floats, row, p) - thrust(st, floats, row, rest))
        )
        total += float(row["dx"]) * (strain_energy + 0.5 * row["flow"] ** 2 / m)
    return float(total)


def friction_memory_energy(model: Model, k: int) -> float:
    """Energy in the memory states of unsteady friction of pipe k [J], for the flow at the start."""
    row = model.tables.pipes[k]
    pipe = model.pipes[k]
    st = model.tables.settings[0]
    share = float(memory_shares(model.tables.floats, row).sum())
    full = st["rho"] * row["area"]
    square = 1.0
    if not model.case.law.linear:  # memory states hold velocities
        square = np.mean((full / model.tables.profile[row["center"] + np.arange(pipe.cells)]) ** 2)
    return float(0.5 * share * square * row["flow"] ** 2 * pipe.length / full)


def creep_energy(model: Model, k: int) -> float:
    """Energy in the creep of the wall of pipe k at the start [J], above that at the reduced pressure P = 0."""
    row = model.tables.pipes[k]
    if row["elements"] == 0:
        return 0.0
    pairs, rest = elements(model.tables.floats, row), pipe_energy(model, k)
    area = float(row["area"])
    rho = model.case.properties.density
    length = model.pipes[k].length
    if model.case.law.linear:
        elastic = rest - float(0.5 * row["flow"] ** 2 * length / (rho * area))
    else:
        from fvsolve.core.kernels.density import pressure_of_mass

        st = model.tables.settings[0]
        floats = model.tables.floats
        profile = model.tables.profile
        p = [
            pressure_of_mass(st, floats, row, float(m))
            for m in profile[row["center"] + np.arange(row["cells"])]
        ]
        excess = (
            np.array(p)
            - st["ambient"]
            + rho * st["gravity"] * (model.pipes[k].elevation - st["datum"])
        )
        elastic = float(0.5 * row["dx"] * area / rho * np.sum((excess / row["speed"]) ** 2))
    return float(np.sum(pairs[:, 0] / pairs[:, 1])) * elastic


def tank_energy_above_datum(model: Model, row) -> float:
    """Energy of a tank at the start [J], above its energy with the surface at the datum.

    If the bottom or the rim of the tank does not allow this level, the nearest possible level counts.
    """
    from fvsolve.core.kernels.network_energy import tank_energy
    from fvsolve.core.kernels.tanks import tank_level

    st, floats = model.tables.settings[0], model.tables.floats
    rho, target = float(row["density"]), float(st["datum"] - row["elevation"])
    low = -float(row["mass"])
    if target <= 0.0:
        return float(-tank_energy(st, floats, row, rho, low))
    added = rho * float(row["area"]) * target + float(row["mass"])
    while (
        tank_level(row, floats, rho, low + added) < target
        and row["mass"] + low + added < row["full"]
    ):
        added *= 2.0
    high = min(float(row["full"] - row["mass"]), low + added)
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if tank_level(row, floats, rho, middle) < target else (low, middle)
        )
    return float(-tank_energy(st, floats, row, rho, high))


@dataclass(frozen=True)
class Account:
    """Line of the energy ledger: sum of powers, or of stored energies, that kernels write, each with a sign.

    place : name of the part; rows : indices of the powers or energies; signs : sign of each
    """

    category: str  # "supplied" | "stored" | "rate" (of stored) | "dissipated" | "scheme" | "law"
    place: str
    kind: str  # "reservoir", "friction", "valve", ...
    rows: tuple[int, ...]
    signs: tuple[float, ...]


class Accounts:
    """Energy accounts of a model, for the run data of a run.

    Accounts of stored energy (`stored_accounts`) and of its rates (category "rate") are in the same order. Tables of
    `run_data` are changed, so that all that energies need is computed. Raises FvsolveError if the energy of the
    case cannot be computed.
    """

    def __init__(self, run_data: RunData) -> None:
        self.run_data, self.model = run_data, run_data.model
        model, case = run_data.model, run_data.model.case
        for own in run_data.features:
            own.for_energy()
        if reason := next(
            (text for feature in model.features if (text := feature.energy_refusal())), ""
        ):
            raise FvsolveError(reason)
        self.power, self.stored = model.functions.energies
        self.accounts: list[Account] = []
        self.stored_accounts: list[Account] = []  # accounts of stored energy, by rows of `stored`
        # lines of the rate and of the loss of every contact
        self.contacts: list[tuple[int, int]] = []
        self.power_count = self.stores = 0
        nodes = model.tables.nodes
        for row, (name, place) in zip(nodes, case.places.items(), strict=True):
            self.node(name, place, int(row["kind"]))
        for pipe, row in zip(model.pipes, model.tables.pipes, strict=True):
            at = self.take(6)
            self.add("dissipated", pipe.name, "friction", at + 1)
            self.add("dissipated", pipe.name, "jet", at + 2)
            if row["elements"] > 0:
                self.add("dissipated", pipe.name, "creep", at + 4)
                self.add("law", pipe.name, "creep", at + 5)
            self.hold(pipe.name, "pipe", at + 3, 2)
            self.accounts.append(
                Account("scheme", pipe.name, "pipe", tuple(range(at, at + 6)), (1, *[-1] * 5))
            )
        self.valves()
        for name in model.column_names:
            at = self.take(3)
            self.add("dissipated", name, "friction", at + 1)
            self.hold(name, "rigid column", at + 2)
            self.accounts.append(
                Account("law", name, "rigid column", (at, at + 1, at + 2), (1, -1, -1))
            )
        self.network_rows = self.power_count  # rows of power that `kernels.network_energy` fills
        for feature in model.features:
            feature.begin_accounts(self)
        for feature in model.features:
            feature.add_accounts(self)
        self.devices()
        for feature in model.features:
            feature.end_accounts(self)
        self.power_terms = terms_of(self.accounts)
        self.stored_terms = terms_of(self.stored_accounts)

    def take(self, count: int) -> int:
        """Reserve `count` new rows of power; return the index of the first."""
        self.power_count += count
        return self.power_count - count

    def add(self, category: str, place: str, kind: str, row: int, sign: float = 1.0) -> None:
        """Add an account with a single row of power; other arguments as in `Account`."""
        self.accounts.append(Account(category, place, kind, (row,), (sign,)))

    def hold(self, place: str, kind: str, rate: int | None, rows: int = 1) -> None:
        """Add an account of a part that stores energy, with its next rows of stored energy.

        rate : row of power that is the time derivative of this energy; None : the rows belong to no account
        """
        at = self.stores
        self.stores += rows
        if rate is not None:
            self.stored_accounts.append(
                Account("stored", place, kind, tuple(range(at, at + rows)), (1.0,) * rows)
            )
            self.add("rate", place, kind, rate)

    def node(self, name: str, place: Any, code: int) -> None:
        at = self.take(2)
        if books := lowering_of(type(place)).ledger_name:
            self.add("supplied", name, books, at)
        # the energy of a vessel is booked by its device
        stores = code in (rec.TANK, rec.CHAMBER, rec.MOVING)
        self.hold(name, place.kind, at + 1 if stores else None)

    def valves(self) -> None:
        # row of a device's restriction, and True if it dissipates
        self.taken: dict[str, tuple[int, bool]] = {}
        resists = {name: device.dissipates(part) for name, part, device in self.model.devices}
        for link, _, lowering in rows_in(self.model.case, "valve"):
            for name in lowering.row_names(link):
                at = self.take(1)
                if name in resists:
                    self.taken[name] = at, resists[name]
                else:
                    self.add("dissipated", name, "valve", at)

    def devices(self) -> None:
        for name, part, _ in self.model.devices:
            at, kind = self.take(3), part.kind.replace("-", " ")
            own, resists = self.taken.get(name, (None, True))
            for category, sign, first, has_own in (
                ("supplied", -1.0, at, not resists),
                ("dissipated", 1.0, at + 2, resists),
            ):
                rows = (first, own) if own is not None and has_own else (first,)
                self.accounts.append(Account(category, name, kind, rows, (1.0, sign)[: len(rows)]))
            self.hold(name, kind, at + 1)

    def of(self, category: str) -> list[int]:
        """Indices of the accounts of a category."""
        return [k for k, account in enumerate(self.accounts) if account.category == category]

    def power_at(self, t: float, y: np.ndarray, dydt: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Power of every account at a state [W] : float64[accounts]; writes `dydt` and `out` at that state."""
        self.model.functions.rhs(t, y, dydt, out, self.run_data.handle)
        return self.power_by(t, y, dydt, out)

    def power_by(self, t: float, y: np.ndarray, dydt: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Power of every account [W] : float64[accounts], at a state with given `dydt` and `out`."""
        rows = np.zeros(self.power_count)
        self.power(t, y, dydt, out, self.run_data.handle, rows)
        return sums_of(self.power_terms, rows, len(self.accounts))

    def stored_at(self, t: float, y: np.ndarray) -> np.ndarray:
        """Stored energy of each storing part, relative to the initial steady state [J] : float64[stored accounts]."""
        rows, out = np.zeros(self.stores), self.model.new_out()
        self.model.functions.rhs(t, y, np.zeros(0), out, self.run_data.handle)
        self.stored(t, y, np.zeros(0), out, self.run_data.handle, rows)
        return sums_of(self.stored_terms, rows, len(self.stored_accounts))


def terms_of(accounts: list[Account]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Terms of the sums of accounts: number of the account, row, and sign of each term."""
    terms = [
        (k, row, sign)
        for k, account in enumerate(accounts)
        for row, sign in zip(account.rows, account.signs, strict=True)
    ]
    numbers, rows, signs = zip(*terms, strict=True) if terms else ((), (), ())
    return (
        np.array(numbers, dtype=np.int64),
        np.array(rows, dtype=np.int64),
        np.array(signs, dtype=np.float64),
    )


def sums_of(
    terms: tuple[np.ndarray, np.ndarray, np.ndarray], rows: np.ndarray, count: int
) -> np.ndarray:
    """Sum of the rows of each account with their signs : float64[count]; terms : result of `terms_of`."""
    numbers, at, signs = terms
    return np.bincount(numbers, signs * rows[at], count)
