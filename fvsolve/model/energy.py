"""The energy of a deviation as a sum of squares: the norm in which growth is measured. Knows tables; steps nothing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.kernels import records as rec
from fvsolve.model.creep import elements
from fvsolve.model.lowering import rows_in
from fvsolve.model.scalars import bounds
from fvsolve.model.statics import factored
from fvsolve.model.unsteady import memory_shares

RANK = 1e-12  # of the greatest singular value of what hangs together: below, a motion stores no energy
TOGETHER = 2500  # positions joined by springs whose singular values are taken, in some 7 s
CARRIED = 1e-6  # of the weight of the mass that it goes with, of an amount: below what waves do to it in 1000 steps
CLOSED = 1e-6  # share of what its terms could add up to, below which a rate is round-off of differences


@dataclass(frozen=True, eq=False)
class EnergyForm:
    """Energy |L y|^2 [J] of a deviation y of n states, and coordinates z = forth y, |z|^2 the same energy.

    rows : sparse float64[m, n]  L, one row for each store; parts : names of what stores, one for each row
    forth : sparse float64[r, n], back : sparse float64[n, r]  forth back = 1
    idle : float64[n, d]  motions that store nothing, such as all positions of a train together; each small
    idle_rows : float64[d, n]  how much of each a deviation holds; least : energy that small deviations have at least
    """

    rows: Any
    parts: tuple[str, ...]
    forth: Any
    back: Any
    idle: np.ndarray
    idle_rows: np.ndarray
    least: float

    @property
    def size(self) -> int:
        """Coordinates z."""
        return self.forth.shape[0]

    def seen(self, a: Any) -> Any:
        """A in coordinates z: forth A back, dense or sparse as A is. What is idle is left out."""
        if isinstance(a, np.ndarray):
            return self.forth @ (a @ self.back.toarray())
        return (self.forth @ a @ self.back).tocsc()

    def closed(self, a: Any) -> bool:
        """Whether A takes idle motions to idle ones, so that growth of the others does not hang on them."""
        if self.idle.shape[1] == 0:
            return True
        most = abs(self.forth) @ (abs(a) @ np.abs(self.idle))
        return bool(np.all(np.abs(self.forth @ (a @ self.idle)) <= CLOSED * most))

    def fitting(self, a: Any) -> EnergyForm:
        """This form where A is `closed`, else the `completed` one."""
        return self if self.closed(a) else self.completed()

    def completed(self) -> EnergyForm:
        """The same with the least weight for idle motions, a norm of all the states."""
        from scipy.sparse import csr_array, hstack, vstack

        if self.idle.shape[1] == 0:
            return self
        root, n = np.sqrt(self.least), self.idle.shape[0]
        more = csr_array(root * self.idle_rows)
        return EnergyForm(
            vstack([self.rows, more]).tocsr(), (*self.parts, *[""] * more.shape[0]),
            vstack([self.forth, more]).tocsr(), hstack([self.back, csr_array(self.idle / root)]).tocsr(),
            np.zeros((n, 0)), np.zeros((0, n)), self.least,
        )  # fmt: skip


def energy_form(model, y: np.ndarray | None = None) -> EnergyForm:
    """The energy of a deviation from the state y, that of the start if None.

    A wave of r [kg/s] stores r^2 dx / (rho A), what unsteady friction (`kernels.unsteady`) or a wall that creeps
    (`kernels.creep`) remembers g z^2 dx / (2 n rho A), a chamber or tank m^2 dp/dm / (2 rho), a rigid column
    M^2 L / (2 rho A), a mass m v^2 / 2, bodies v' M v / 2, the spring of a joint k s^2 / 2, a spring and a stop in
    touch k (x_j - x_i)^2 / 2, a chamber of a cylinder dp/dm (e - x A e0 / V)^2 / (2 rho) with e0 its excess at y. Exact
    under `linear` about a profile at rest.
    Devices store what their `squares` say, cells of basins what `basins.lower_energy` says. A scalar stores nothing; a
    deviation of its amount, over the greatest value that there can be, counts as 1e-6 of what so much mass would store,
    for nothing else hangs on it. Positions that nothing holds, one by one or together, store nothing: idle.
    """
    from scipy.sparse import csr_array

    y = np.zeros(model.y_size) if y is None else y
    own = energy_weights(model, y)
    names = [name.rsplit(".", 1)[0] for name in model.state_names]
    stored = {i: (names[i], {i: float(np.sqrt(own[i]))}) for i in np.flatnonzero(own)}
    grows = Lengthening(model, y)
    stored |= {e: (names[e], row) for e, row in swept(model, y, grows)}
    found = [*stored.values(), *stretched(model, y, grows), *of_devices(model, y)]
    found += [*kinetic(model, y), *sprung(model)]
    entries = [(k, i, value) for k, (_, row) in enumerate(found) for i, value in row.items()]
    row, column, value = (np.array(one) for one in zip(*entries, strict=True))
    matrix = csr_array((value, (row, column)), shape=(len(found), model.y_size))
    return form_of(matrix, tuple(name for name, _ in found), model.scale)


def form_of(rows: Any, parts: tuple[str, ...], scale: np.ndarray) -> EnergyForm:
    """Coordinates of |L y|^2 : state by state where a row has one, else by singular values of what hangs together.

    scale : float64[n]  what counts as a small deviation: so much of each state is compared. Raises FvsolveError where
    too much hangs together.
    """
    from scipy.sparse import coo_array

    alone, blocks = apart(rows)
    n, r = rows.shape[1], alone.size
    own = np.asarray(np.abs(rows[:, alone]).sum(axis=0)).ravel() if r else np.zeros(0)
    to, fro = [(np.arange(r), alone, own)], [(alone, np.arange(r), 1.0 / own)]
    idle, idle_rows = [np.zeros((n, 0))], [np.zeros((0, n))]
    for at in blocks:
        if at.size > TOGETHER:
            raise FvsolveError(
                f"{at.size} masses hang together: their energy norm is found up to {TOGETHER}; take fewer"
            )
        part = rows[:, at].toarray() * scale[at]
        part = np.vstack([part[np.any(part, axis=1)], np.zeros((1, at.size))])
        _, sizes, v = np.linalg.svd(part, full_matrices=part.shape[0] < at.size)
        k = int(np.sum(sizes > RANK * sizes[0]))
        here, there = np.repeat(np.arange(r, r + k), at.size), np.tile(at, k)
        to.append((here, there, (sizes[:k, None] * v[:k] / scale[at]).ravel()))
        fro.append((there, here, (v[:k] * scale[at] / sizes[:k, None]).ravel()))
        rest = np.zeros((at.size - k, n))
        rest[:, at] = v[k:]
        idle.append((rest * scale).T)
        idle_rows.append(rest / scale)
        r += k
    (i, j, v), (p, q, w) = (map(np.concatenate, zip(*pieces, strict=True)) for pieces in (to, fro))
    forth, back = coo_array((v, (i, j)), shape=(r, n)).tocsr(), coo_array((w, (p, q)), shape=(n, r)).tocsr()
    small = np.asarray((back.multiply(1.0 / scale[:, None]).tocsr() ** 2).sum(axis=0)).ravel()
    return EnergyForm(rows, parts, forth, back, np.hstack(idle), np.vstack(idle_rows), float(1.0 / small.max()))


def apart(rows: Any) -> tuple[np.ndarray, list[np.ndarray]]:
    """(states with one row that is theirs alone, groups of the others that rows join)."""
    from scipy.sparse.csgraph import connected_components

    single = np.diff(rows.tocsr().indptr) == 1
    ones = (rows != 0).astype(int)
    alone = (ones.sum(axis=0) == 1) & (ones[single].sum(axis=0) == 1)
    others = np.flatnonzero(~alone)
    part = ones[:, others]
    count, labels = connected_components(part.T @ part, directed=False)
    return np.flatnonzero(alone), [others[labels == k] for k in range(count)]


def energy_weights(model, y: np.ndarray | None = None) -> np.ndarray:
    """Weights w of states that store w_i d_i^2 of a deviation d from y by themselves, 0 of others : float64[n]."""
    y = np.zeros(model.y_size) if y is None else y
    tables, rho = model.tables, model.case.properties.density
    found = np.zeros(model.y_size)
    for row in tables.pipes:
        found[row["y"] : row["y"] + 2 * row["cells"]] = row["dx"] / (rho * row["area"])
        shares = memory_shares(tables.floats, row)
        kept = slice(row["memory"], row["memory"] + shares.size * row["cells"])
        found[kept] = 0.5 * row["dx"] / (rho * row["area"]) * np.repeat(shares, row["cells"])
        for k, (gain, rate) in enumerate(elements(tables.floats, row)):
            first = row["strain"] + k * row["cells"]
            found[first : first + row["cells"]] = 0.5 * row["dx"] / (rho * row["area"]) * gain / rate
    for basin in model.basins:
        basin.own(found)[:] = basin.weights(basin.of(y))
        for q, amount in enumerate(basin.amounts(found) if basin.scalars else ()):
            amount[:] = CARRIED * 0.5 * basin.mesh.area / typical(model, q) ** 2
    for row in tables.nodes:
        if row["y"] >= 0 and row["kind"] not in (rec.MOVING, rec.VESSEL):
            found[row["y"]] = stiffness(model, row) / (2.0 * rho)
    for row in tables.columns:
        found[row["y"]] = row["length"] / (2.0 * rho * row["area"])
    for row in tables.masses:
        if row["y"] >= 0:
            found[int(row["y"]) + 1] = 0.5 / row["lightness"]
    weigh_scalars(model, found)
    return found


def weigh_scalars(model, found: np.ndarray) -> None:
    """Weights of amounts in pipes, and in nodes that store, from those of the mass there."""
    tables, rho = model.tables, model.case.properties.density
    for q, scalar in enumerate(tables.scalars):
        share = CARRIED / typical(model, q) ** 2
        for row in tables.pipes:
            cells = slice(scalar["y"] + row["cell"], scalar["y"] + row["cell"] + row["cells"])
            found[cells] = share * row["dx"] * row["speed"] ** 2 / (rho * row["area"])
        places = tables.integers[scalar["places"] :]
        for place, node in zip(places, tables.nodes, strict=False):
            if node["kind"] in (rec.TANK, rec.CHAMBER):
                found[place] = share * found[node["y"]]


def typical(model, q: int) -> float:
    """The greatest size of a scalar's values that there can be; 1 where all are 0."""
    return max(map(abs, bounds(model.case, list(model.case.scalars)[q]))) or 1.0


def stretched(model, y: np.ndarray, grows: Lengthening):
    """(name, row of L) of springs and of stops in touch."""
    braces, stops = rows_in(model.case, "brace"), rows_in(model.case, "stop")
    for k, ((name, *_), row) in enumerate(zip(braces, model.tables.braces, strict=True)):
        if row["stiffness"] > 0.0:
            yield name, grows.by(k, row["from_mass"], row["to_mass"], float(np.sqrt(0.5 * row["stiffness"])))
    for k, ((name, *_), row) in enumerate(zip(stops, model.tables.stops, strict=True), len(braces)):
        x = grows.travel(k)
        if row["below"] + x < 0.0 or x > row["above"]:
            yield name, grows.by(k, row["from_mass"], row["to_mass"], float(np.sqrt(0.5 * row["stiffness"])))


def of_devices(model, y: np.ndarray):
    """(name, row of L) of what devices store."""
    if not model.devices:
        return
    out = model.evaluate(model.case.numerics.start, y)[1]
    for (name, part, device), row in zip(model.devices, model.tables.devices, strict=True):
        for square in device.squares(model, part, row, y, out):
            yield name, square


def swept(model, y: np.ndarray, grows: Lengthening):
    """(state, row of L) of moving chambers at y: with less room the same excess e [kg] is more pressure.

    Between points the state is the mass, e and what its volume has gained at the density of the start.
    """
    nodes, pistons = model.tables.nodes, model.tables.pistons
    per_mass, first = grows.out[int(model.layout["stiffness"]) :], len(model.tables.braces) + len(model.tables.stops)
    for k, row in enumerate(pistons, first):
        x = grows.travel(k)
        for name, sign in (("a", 1.0), ("b", -1.0)):
            node, area, sweep = nodes[row[name]], sign * float(row[f"area_{name}"]), float(row[f"sweep_{name}"])
            at, volume = int(node["y"]), float(node["volume"] + area * x)
            excess = float(y[at]) - (sweep * x if row["line"] >= 0 else 0.0)
            added = excess / volume  # density, over that of the start
            root = float(np.sqrt(per_mass[node["row"]] / (2.0 * (sweep / area + added))))
            per_travel = added * area + (sweep if row["line"] >= 0 else 0.0)
            moved = grows.by(k, row["case"], row["rod"], -root * per_travel) if per_travel else {}
            yield at, {at: root} | moved


class Lengthening:
    """By how much pushes have grown at a state, and what deviations of states add to that.

    out : what the rhs writes beside dydt there
    """

    def __init__(self, model, y: np.ndarray) -> None:
        self.model, self.y = model, y
        self.t = model.case.numerics.start
        self.out = model.evaluate(self.t, y)[1]
        self.first = int(model.layout["travel"])

    def travel(self, k: int) -> float:
        """Of push k [m]."""
        return float(self.out[self.first + 2 * k])

    def by(self, k: int, i: int, j: int, factor: float) -> dict[int, float]:
        """Row of `factor` times the growth of push k, between masses i and j, or two points."""
        places = self.model.tables.masses["y"]
        if i != j:
            return {int(places[m]): sign * factor for m, sign in ((i, -1.0), (j, 1.0)) if places[m] >= 0}
        return {at: factor * float(row[2 * k]) for at, row in self.slopes.items() if row[2 * k] != 0.0}

    @cached_property
    def slopes(self) -> dict[int, np.ndarray]:
        """Coordinate of a joint -> d travel of all pushes / d coordinate."""
        tables, found = self.model.tables, {}
        last = self.first + 2 * (len(tables.braces) + len(tables.stops) + len(tables.pistons))
        for body in tables.bodies:
            many = int(body["freedoms"]) + (body["freedoms"] >= 3)
            for at in range(int(body["y"]), int(body["y"]) + many):
                step = 1e-6 * (self.model.scale[at] + abs(self.y[at])) * 1e2
                high, low = self.y.copy(), self.y.copy()
                high[at], low[at] = high[at] + step, low[at] - step
                ends = [self.model.evaluate(self.t, one)[1][self.first : last] for one in (high, low)]
                found[at] = (ends[0] - ends[1]) / (high[at] - low[at])
        return found


def kinetic(model, y: np.ndarray):
    """(name, row of L) of bodies: v' M v / 2 = |L v|^2 / 2 with the factor of M that the kernels have."""
    bodies, freedoms, n = model.tables.bodies, model.tables.freedoms, len(model.tables.freedoms)
    if not n:
        return
    factor = factored(model, y)[8 * n :]
    rate = [int(body["rate"]) + k for body in bodies for k in range(body["freedoms"])]
    names = [name for name, body in zip(model.body_names, bodies, strict=True) for _ in range(body["freedoms"])]
    for name, row in zip(names, freedoms, strict=True):
        path = model.tables.integers[row["path"] : row["path"] + row["depth"] + 1]
        entries = np.sqrt(0.5) * factor[row["row"] : row["row"] + row["depth"] + 1]
        yield name, {rate[j]: float(entry) for j, entry in zip(path, entries, strict=True)}


def sprung(model):
    """(name, row of L) of springs of joints."""
    for name, body in zip(model.body_names, model.tables.bodies, strict=True):
        if body["stiffness"] > 0.0:
            yield name, {int(body["y"]): float(np.sqrt(0.5 * body["stiffness"]))}


def stiffness(model, row) -> float:
    """Pressure per stored mass [Pa/kg] of a node that stores, at its profile."""
    if row["kind"] == rec.TANK and row["shape"] >= 0:
        floats, at, n = model.tables.floats, int(row["shape"]), int(row["shapes"])
        return float(model.case.gravity / np.interp(row["level"], floats[at : at + n], floats[at + n : at + 2 * n]))
    return float(row["stiffness"])
