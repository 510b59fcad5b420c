"""Energy norm of small deviations: their energy as a sum of squares, in which growth is measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.core.assembly.pipe_terms import elements, memory_shares
from fvsolve.core.kernels import dtypes as rec
from fvsolve.errors import FvsolveError

# singular values below this share of a group's greatest: motions that store no energy
RANK_TOLERANCE = 1e-12
# largest group of positions joined by springs whose singular values are computed, in about 7 s
MAX_GROUP = 2500
# weight of a scalar's amount, as a share of that of its mass: less than waves do to it in 1000 steps
SCALAR_WEIGHT = 1e-6
# rates below this share of the sum of magnitudes of their terms are round-off of differences
ROUNDING_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class EnergyForm:
    """Energy |L d|^2 [J] of a small deviation d of n states, and coordinates z = forward d with this energy |z|^2.

    rows : sparse float64[m, n]  matrix L, a row for each store of energy; parts : name of the part of each row
    forward : sparse float64[r, n], back : sparse float64[n, r]  forward back = 1
    idle : float64[n, k]  motions without energy, such as a common displacement of a whole train; each is small
    idle_rows : float64[k, n]  matrix that gives the amount of each motion without energy in a deviation
    least : least energy of a deviation of the size `Model.scale` [J]
    """

    rows: Any
    parts: tuple[str, ...]
    forward: Any
    back: Any
    idle: np.ndarray
    idle_rows: np.ndarray
    least: float

    @property
    def size(self) -> int:
        """Number of coordinates z."""
        return self.forward.shape[0]

    def seen(self, a: Any) -> Any:
        """Matrix A in coordinates z: forward A back, dense or sparse like A. Motions without energy are left out."""
        if isinstance(a, np.ndarray):
            return self.forward @ (a @ self.back.toarray())
        return (self.forward @ a @ self.back).tocsc()

    def closed(self, a: Any) -> bool:
        """True if A maps motions without energy to motions without energy; other motions then grow independently."""
        if self.idle.shape[1] == 0:
            return True
        most = abs(self.forward) @ (abs(a) @ np.abs(self.idle))
        return bool(np.all(np.abs(self.forward @ (a @ self.idle)) <= ROUNDING_SHARE * most))

    def suited_to(self, a: Any) -> EnergyForm:
        """This form if A maps motions without energy to motions without energy, else `full_norm`."""
        return self if self.closed(a) else self.full_norm()

    def full_norm(self) -> EnergyForm:
        """Energy form in which a motion without energy, in the amount 1, has the energy `least`.

        Thus it is a norm of all states.
        """
        from scipy.sparse import csr_array, hstack, vstack

        if self.idle.shape[1] == 0:
            return self
        root, n = np.sqrt(self.least), self.idle.shape[0]
        more = csr_array(root * self.idle_rows)
        return EnergyForm(
            vstack([self.rows, more]).tocsr(),
            (*self.parts, *[""] * more.shape[0]),
            vstack([self.forward, more]).tocsr(),
            hstack([self.back, csr_array(self.idle / root)]).tocsr(),
            np.zeros((n, 0)),
            np.zeros((0, n)),
            self.least,
        )


def energy_form(model, y: np.ndarray | None = None) -> EnergyForm:
    """Energy form of small deviations from the state y, or from the start if y is None.

    Energy of a deviation, with density rho, area A and cell length dx:
    wave r [kg/s] in a cell : r^2 dx / (rho A)
    memory state z [kg/s] of unsteady friction or of a creeping wall, its term with gain g and rate n [1/s] :
    g z^2 dx / (2 n rho A)
    excess mass m [kg] in a chamber or tank : m^2 dp/dm / (2 rho)
    mass flow M [kg/s] in a rigid column of length L : M^2 L / (2 rho A)
    potential or flow d of a store of rotation or electricity with the value C : C d^2 / 2; of a heat capacity 1e-6 of
    this

    Devices and features add rows (`energy_rows`, `squares`), features weights of their states. The form is exact under
    the density law `linear` about a steady state at rest. A scalar stores no energy, and no other state depends on it;
    a deviation of its amount, divided by its greatest possible value, counts as 1e-6 of the energy that the same mass
    would store. Displacements without stiffness store nothing, see `EnergyForm.idle`. Raises FvsolveError if springs
    join too many positions.
    """
    from scipy.sparse import csr_array

    y = np.zeros(model.y_size) if y is None else y
    own = energy_weights(model, y)
    names = [name.rsplit(".", 1)[0] for name in model.state_names]
    stored = {i: (names[i], {i: float(np.sqrt(own[i]))}) for i in np.flatnonzero(own)}
    squares = [feature.squares(model, y) for feature in model.features]
    stored |= {e: (names[e], row) for own in squares for e, row in own.stored.items()}
    parts = [
        *stored.values(),
        *(row for own in squares for row in own.first),
        *device_rows(model, y),
    ]
    parts += [row for own in squares for row in own.last]
    parts += [row for feature in model.features for row in feature.energy_rows(model)]
    entries = [(k, i, value) for k, (_, row) in enumerate(parts) for i, value in row.items()]
    row, column, value = (np.array(column_values) for column_values in zip(*entries, strict=True))
    matrix = csr_array((value, (row, column)), shape=(len(parts), model.y_size))
    return form_of(matrix, tuple(name for name, _ in parts), model.scale)


def form_of(rows: Any, parts: tuple[str, ...], scale: np.ndarray) -> EnergyForm:
    """Energy form of |L d|^2 from the matrix L.

    rows : L; parts : name of the part of each row; scale : float64[n]  size of a small deviation of each state
    A state with a row of its own gives a coordinate. In each group of other states that rows join, coordinates and
    motions without energy follow from a singular value decomposition. Raises FvsolveError if a group is too large.
    """
    from scipy.sparse import coo_array

    alone, blocks = split_states(rows)
    n, r = rows.shape[1], alone.size
    own = np.asarray(np.abs(rows[:, alone]).sum(axis=0)).ravel() if r else np.zeros(0)
    forth_entries, back_entries = [(np.arange(r), alone, own)], [(alone, np.arange(r), 1.0 / own)]
    idle, idle_rows = [np.zeros((n, 0))], [np.zeros((0, n))]
    for at in blocks:
        if at.size > MAX_GROUP:
            raise FvsolveError(
                f"{at.size} positions are joined by springs; the energy norm is computed for at most {MAX_GROUP}; "
                "expected fewer parts that springs join to each other"
            )
        part = rows[:, at].toarray() * scale[at]
        part = np.vstack([part[np.any(part, axis=1)], np.zeros((1, at.size))])
        _, sizes, v = np.linalg.svd(part, full_matrices=part.shape[0] < at.size)
        k = int(np.sum(sizes > RANK_TOLERANCE * sizes[0]))
        z_index, state_index = np.repeat(np.arange(r, r + k), at.size), np.tile(at, k)
        forth_entries.append((z_index, state_index, (sizes[:k, None] * v[:k] / scale[at]).ravel()))
        back_entries.append((state_index, z_index, (v[:k] * scale[at] / sizes[:k, None]).ravel()))
        rest = np.zeros((at.size - k, n))
        rest[:, at] = v[k:]
        idle.append((rest * scale).T)
        idle_rows.append(rest / scale)
        r += k
    (i, j, v), (p, q, w) = (
        map(np.concatenate, zip(*pieces, strict=True)) for pieces in (forth_entries, back_entries)
    )
    forth = coo_array((v, (i, j)), shape=(r, n)).tocsr()
    back = coo_array((w, (p, q)), shape=(n, r)).tocsr()
    small = np.asarray((back.multiply(1.0 / scale[:, None]).tocsr() ** 2).sum(axis=0)).ravel()
    return EnergyForm(
        rows, parts, forth, back, np.hstack(idle), np.vstack(idle_rows), float(1.0 / small.max())
    )


def split_states(rows: Any) -> tuple[np.ndarray, list[np.ndarray]]:
    """Split states : (indices of states that are alone in their row of L, groups of other states that rows join).

    A state without a row is a group of its own.
    """
    from scipy.sparse.csgraph import connected_components

    single = np.diff(rows.tocsr().indptr) == 1
    nonzero = (rows != 0).astype(int)
    alone = (nonzero.sum(axis=0) == 1) & (nonzero[single].sum(axis=0) == 1)
    others = np.flatnonzero(~alone)
    part = nonzero[:, others]
    count, labels = connected_components(part.T @ part, directed=False)
    return np.flatnonzero(alone), [others[labels == k] for k in range(count)]


def energy_weights(model, y: np.ndarray | None = None) -> np.ndarray:
    """Weights w of states that store energy independently of other states : float64[n], 0 for other states.

    A deviation d_i of state i from y stores w_i d_i^2 [J].
    """
    y = np.zeros(model.y_size) if y is None else y
    tables, rho = model.tables, model.case.properties.density
    weights = np.zeros(model.y_size)
    for row in tables.pipes:
        weights[row["y"] : row["y"] + 2 * row["cells"]] = row["dx"] / (rho * row["area"])
        shares = memory_shares(tables.floats, row)
        memory = slice(row["memory"], row["memory"] + shares.size * row["cells"])
        weights[memory] = 0.5 * row["dx"] / (rho * row["area"]) * np.repeat(shares, row["cells"])
        for k, (gain, rate) in enumerate(elements(tables.floats, row)):
            first = row["strain"] + k * row["cells"]
            weights[first : first + row["cells"]] = (
                0.5 * row["dx"] / (rho * row["area"]) * gain / rate
            )
    for row in tables.nodes:
        if row["y"] >= 0 and row["kind"] not in (rec.MOVING, rec.VESSEL):
            weights[row["y"]] = stiffness(model, row) / (2.0 * rho)
    for row in tables.columns:
        weights[row["y"]] = row["length"] / (2.0 * rho * row["area"])
    for feature in model.features:
        feature.weigh(model, weights, y)
    return weights


def device_rows(model, y: np.ndarray):
    """Yield (name, state -> factor) of each row of L for the energy stored by devices."""
    if not model.devices:
        return
    out = model.evaluate(model.case.numerics.start, y)[1]
    for (name, part, device), row in zip(model.devices, model.tables.devices, strict=True):
        for square in device.energy_rows(model, part, row, y, out):
            yield name, square


def stiffness(model, row) -> float:
    """Pressure per stored mass [Pa/kg] of a tank or chamber at the start."""
    if row["kind"] == rec.TANK and row["shape"] >= 0:
        floats = model.tables.floats
        at = int(row["shape"])
        n = int(row["shapes"])
        return float(
            model.case.gravity
            / np.interp(row["level"], floats[at : at + n], floats[at + n : at + 2 * n])
        )
    return float(row["stiffness"])
