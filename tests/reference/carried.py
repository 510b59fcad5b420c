"""Advection and diffusion of scalars on a rectangle by the kernels of fvsolve and explicit steps in NumPy."""

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.mesh import rectangle
from fvsolve.features.basins import advection, fifth_order
from fvsolve.features.basins.advection import AdvectionGrid, GridFlows
from fvsolve.features.basins.transport.lower import face_flows, grid_flows

SCHEMES = {
    "upwind": (rec.UPWIND, 0),
    "minmod": (rec.MUSCL, rec.MINMOD),
    "van-leer": (rec.MUSCL, rec.VAN_LEER),
    "monotonized-central": (rec.MUSCL, rec.MONOTONIZED_CENTRAL),
    "upwind5": (rec.LINEAR, 0),
    "weno5": (rec.WENO5, 0),
}
NONE = np.zeros(0)


class Carried:
    """Rectangle with given flows through its faces, and the rates of a scalar by a scheme."""

    def __init__(
        self,
        scheme,
        mesh,
        flow_x,
        flow_y,
        outside=0.0,
        bounds=(-np.inf, np.inf),
        depth=NONE,
        diffusivity=0.0,
    ):
        grid = mesh.grid
        self.mesh, self.nx, self.ny, self.diffusivity = mesh, grid.nx, grid.ny, diffusivity
        self.kx, self.ky = 1.0 / np.diff(grid.x), 1.0 / np.diff(grid.y)
        self.flow_x, self.flow_y, self.depth, self.bounds = flow_x, flow_y, depth, bounds
        self.outside = np.broadcast_to(outside, 2 * (self.nx + self.ny)).astype(float).copy()
        self.scheme, self.limiter = SCHEMES[scheme]
        size = self.nx, self.ny
        self.work = np.full(
            max(advection.advection_work(*size), fifth_order.fifth_order_work(*size)), np.nan
        )
        self.other = np.full(advection.diffusion_work(*size), np.nan)
        self.fastest = self.greatest_rate()

    @property
    def grid(self):
        return AdvectionGrid(self.nx, self.ny, 0, self.ny, self.kx, self.ky)

    def flows(self, factor=1.0):
        return GridFlows(factor, self.flow_x, self.flow_y, self.outside)

    def greatest_rate(self):
        """Greatest rate |u| kx + |v| ky over the cells, with the greater velocity of two opposite faces [1/s]."""
        u, v = (
            np.abs(f.reshape(shape))
            for f, shape in ((self.flow_x, (self.ny, -1)), (self.flow_y, (-1, self.nx)))
        )
        u, v = np.maximum(u[:, 1:], u[:, :-1]), np.maximum(v[1:], v[:-1])
        rates = self.kx * self.ky[:, None] * (u + v)
        depth = self.depth.reshape(rates.shape) if self.depth.size else 1.0
        return np.max(rates / np.maximum(depth, advection.THIN))

    def rates(self, s, factor=1.0):
        rate, field = np.empty_like(s), (self.flows(factor), self.depth)
        advection.grid_advection(self.scheme, self.limiter, self.grid, *field, s, self.work, rate)
        if self.scheme in (rec.LINEAR, rec.WENO5):
            fifth_order.add_fifth_order(
                self.scheme, self.grid, *field, self.bounds, self.fastest, s, self.work, rate
            )
        if self.diffusivity:
            advection.grid_diffusion(self.grid, self.diffusivity, *field, s, self.other, rate)
        return rate

    def run(self, s, end, courant, method="ssp-rk3", factor=lambda t: 1.0):
        """Values at time `end`, by equal steps of a Courant number.

        The Courant number refers to the sum of the greatest rates of advection and of diffusion.
        """
        quick = self.fastest + 2.0 * self.diffusivity * (self.kx.max() ** 2 + self.ky.max() ** 2)
        steps = int(np.ceil(end * quick / courant))
        h = end / steps
        for k in range(steps):
            t = k * h
            a = self.rates(s, factor(t))
            if method == "rk4":
                b = self.rates(s + 0.5 * h * a, factor(t + 0.5 * h))
                c = self.rates(s + 0.5 * h * b, factor(t + 0.5 * h))
                s = s + h / 6.0 * (a + 2.0 * b + 2.0 * c + self.rates(s + h * c, factor(t + h)))
                continue
            one = s + h * a
            b = one + h * self.rates(one, factor(t + h))
            if method == "ssp-rk2":
                s = 0.5 * (s + b)
            else:
                two = 0.75 * s + 0.25 * b
                s = s / 3.0 + 2.0 / 3.0 * (two + h * self.rates(two, factor(t + 0.5 * h)))
        return s


def carried(scheme, cells, velocity, size=(1.0, 1.0), grading=(1.0, 1.0), **more) -> Carried:
    """Rectangle with the flows of a velocity, given in the form that `face_flows` reads."""
    mesh = rectangle(size, (cells, cells) if np.isscalar(cells) else cells, grading=grading)
    return Carried(scheme, mesh, *grid_flows(mesh, face_flows(mesh, velocity)), **more)


def means(mesh, f, points=4):
    """Means of f(x, y) over the cells of a rectangle by Gauss quadrature : float64[n]."""
    at, weight = np.polynomial.legendre.leggauss(points)
    mid = [0.5 * (line[1:] + line[:-1]) for line in (mesh.grid.x, mesh.grid.y)]
    wide = [np.diff(line) for line in (mesh.grid.x, mesh.grid.y)]
    total = 0.0
    for a, wa in zip(at, weight, strict=True):
        for b, wb in zip(at, weight, strict=True):
            x, y = np.meshgrid(mid[0] + 0.5 * a * wide[0], mid[1] + 0.5 * b * wide[1])
            total = total + 0.25 * wa * wb * f(x, y)
    return total.ravel()


def enters(come, excess, slender, diffusivity, outside, depth, s):
    """Inflow of a scalar through a boundary face by advection and diffusion.

    slender : half the width of the cell over the length of the face
    """
    own = s / max(depth, advection.THIN)
    if come > 0.0:
        return come * outside + excess + diffusivity * depth / slender * (outside - own)
    return come * own + excess


def ring_rates(
    nx, ny, kx, ky, diffusivity, factor, flow_x, flow_y, depth, outside, ax, ay, s, ring
):
    """Inflow through every face of the boundary by advection and diffusion : ring float64[ring] [m2/s times value].

    ax, ay : excesses that `add_fifth_order` leaves in work[n:], in the order of flow_x and then of flow_y. They are
    empty for all other schemes, and lost if the diffusion uses this work array. The sum of `ring` is the sum of rates
    times areas.
    """
    m, last = nx + 1, ny * nx
    diffusivity = diffusivity if depth.size == 0 else 0.0
    for j in range(ny):
        for side in range(2):
            turn, face = (factor, j * m) if side == 0 else (-factor, j * m + nx)
            k, i = (j * nx, 0) if side == 0 else ((j + 1) * nx - 1, nx - 1)
            h = depth[k] if depth.size > 0 else 1.0
            more = turn * ax[face] if ax.size > 0 else 0.0
            at = side * ny + j
            ring[at] = enters(
                turn * flow_x[face], more, 0.5 * ky[j] / kx[i], diffusivity, outside[at], h, s[k]
            )
    for i in range(nx):
        for side in range(2):
            turn, face = (factor, i) if side == 0 else (-factor, last + i)
            k, j = (i, 0) if side == 0 else (last - nx + i, ny - 1)
            h = depth[k] if depth.size > 0 else 1.0
            more = turn * ay[face] if ay.size > 0 else 0.0
            at = 2 * ny + side * nx + i
            ring[at] = enters(
                turn * flow_y[face], more, 0.5 * kx[i] / ky[j], diffusivity, outside[at], h, s[k]
            )
