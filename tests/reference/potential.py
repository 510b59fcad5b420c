"""Small oscillations of water in a tank as potential flow by finite elements, independent of fvsolve.

phi_z = w^2 phi / g holds at the mean level of the free surface, and phi_n is the normal velocity of the walls. The
added inertia is the integral of phi phi_n over the walls. The gravity torque of still water is omitted.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

GAUSS = (-1.0 / np.sqrt(3.0), 1.0 / np.sqrt(3.0))


def added(side, depth, low, square, gravity, turns, is_round, n=40):
    """Added inertia over density [m3 or m5], extrapolated from two meshes.

    The result of a box is per length of its second side; that of a cylinder of diameter `side` is its total.
    low : height of the bed over the axis of rotation; square : w^2
    """
    coarse, fine = (
        of_mesh(side, depth, low, square / gravity, turns, is_round, k) for k in (n, 2 * n)
    )
    return (4.0 * fine - coarse) / 3.0 * (np.pi if is_round else 1.0)


def of_mesh(side, depth, low, per, turns, is_round, n):
    """Added inertia over density by n elements across, without extrapolation.

    For a cylinder the result is divided by pi; its axes are r and z, and the factor cos(angle) is separated.
    """
    wide = 0.5 * side if is_round else side
    many = int(np.clip(n * depth / wide, 8, 3 * n))
    x, z = (
        np.linspace(wide - side if not is_round else 0.0, wide, n + 1),
        np.linspace(0.0, depth, many + 1),
    )
    x = x if is_round else x - 0.5 * (x[0] + x[-1])
    hx, hz, node = (
        x[1] - x[0],
        z[1] - z[0],
        np.arange((n + 1) * (many + 1)).reshape(many + 1, n + 1),
    )
    i, j = (one.ravel() for one in np.meshgrid(np.arange(n), np.arange(many)))
    corners = np.stack([node[j, i], node[j, i + 1], node[j + 1, i + 1], node[j + 1, i]], axis=1)
    own, load = np.zeros((i.size, 4, 4)), np.zeros(node.size)
    for a in GAUSS:
        for b in GAUSS:
            at = 0.25 * np.array(
                [(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)]
            )
            dx = 0.5 / hx * np.array([b - 1, 1 - b, 1 + b, -1 - b])
            dz = 0.5 / hz * np.array([a - 1, -1 - a, 1 + a, 1 - a])
            r = x[i] + 0.5 * hx * (a + 1.0) if is_round else np.ones(i.size)
            own += 0.25 * hx * hz * r[:, None, None] * (np.outer(dx, dx) + np.outer(dz, dz))
            own += 0.25 * hx * hz / r[:, None, None] * np.outer(at, at) if is_round else 0.0
    rows, columns, values = (
        [np.repeat(corners, 4, axis=1)],
        [np.tile(corners, (1, 4))],
        [own.reshape(-1, 16)],
    )
    for a in GAUSS:
        two = 0.5 * np.array([1.0 - a, 1.0 + a])
        far, high = x[:-1] + 0.5 * hx * (a + 1.0), z[:-1] + 0.5 * hz * (a + 1.0) + low
        r = far if is_round else np.ones(n)
        top = np.stack([node[-1, :-1], node[-1, 1:]], axis=1)
        rows.append(np.repeat(top, 2, axis=1))
        columns.append(np.tile(top, (1, 2)))
        values.append(-per * 0.5 * hx * r[:, None] * np.outer(two, two).ravel())
        for k in range(2):
            push = 0.5 * hz * two[k] * (high if turns else 1.0)
            np.add.at(load, node[k : many + k, -1], push * (x[-1] if is_round else 1.0))
            if not is_round:
                np.add.at(load, node[k : many + k, 0], -push)
            if turns:
                np.add.at(load, node[0, k : n + k], 0.5 * hx * two[k] * far * r)
    places = tuple(np.concatenate([one.ravel() for one in part]) for part in (rows, columns))
    matrix = coo_array(
        (np.concatenate([one.ravel() for one in values]), places), shape=(node.size,) * 2
    ).tocsr()
    free = np.setdiff1d(node, node[:, 0]) if is_round else node.ravel()
    return load[free] @ spsolve(matrix[free][:, free].tocsc(), load[free])
