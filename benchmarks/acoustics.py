"""Pulse in a lossless pipe between a reservoir and a closed end, and its ordinary differential equations.

The class `Acoustics` gives other solvers the compiled rates of fvsolve's model, and the exact solution.
"""

from functools import cached_property

import networks
import numba
import numpy as np
from pointer import pointer
from scipy.sparse import csc_array, hstack
from scipy.sparse.linalg import expm_multiply

from fvsolve.case import load
from fvsolve.core.model import RunData, State, build
from fvsolve.core.steppers.run_handle import addresses, call_rhs

LENGTH = SPEED = 1000.0  # [m, m/s]
END = 2.0  # twice the travel time of the pipe [s]
WIDTH = 0.08  # of the pulse exp(-((x - 1/2) / WIDTH)^2), in lengths of the pipe


def case(cells: int, scheme: str = "upwind5", **numerics) -> dict:
    """Case of the pipe at rest."""
    main = {
        "type": "pipe",
        "from": "lake",
        "to": "end",
        "length": LENGTH,
        "diameter": 0.5,
        "wave_speed": SPEED,
    }
    return {
        "schema": 1,
        "title": "a pulse in a pipe",
        "fluid": dict(networks.WATER),
        "nodes": {"lake": {"type": "reservoir", "head": 100.0}, "end": {"type": "junction"}},
        "links": {"main": main | {"friction": {"model": "none"}, "cells": cells}},
        "numerics": {"end": END, "scheme": scheme, **numerics},
        "output": {"fields": 0, "probes": ["end.head"]},
    }


class Acoustics:
    """Pipe as y' = L y from a pulse.

    States are in fvsolve's order or interleaved; interleaved states give L a narrow band.
    """

    def __init__(self, cells: int) -> None:
        self.cells = cells
        self.model = self.build(method="rk4", courant=1.0)
        # interleaved -> fvsolve's position
        self.mixed = np.arange(2 * cells).reshape(2, cells).T.ravel()
        self.rhs = self._rhs()
        self.rhs_mixed = self._rhs_mixed()

    def build(self, **numerics):
        """Model of the case with these numerics."""
        return build(load(case(self.cells, **numerics)))

    @cached_property
    def start(self) -> State:
        """State at the start: a forward wave with the shape of the pulse."""
        x = (np.arange(self.cells) + 0.5) / self.cells
        return State(
            0.0, np.concatenate([np.exp(-(((x - 0.5) / WIDTH) ** 2)), np.zeros(self.cells)])
        )

    @cached_property
    def matrix(self) -> csc_array:
        """Matrix L of the linear rates : csc[n, n] [1/s], computed column by column."""
        rate, columns = np.empty(2 * self.cells), []
        for j in range(2 * self.cells):
            unit = np.zeros(2 * self.cells)
            unit[j] = 1.0
            self.rhs(0.0, unit, rate)
            columns.append(csc_array(rate[:, None]))
        return hstack(columns, format="csc")

    @cached_property
    def exact(self) -> np.ndarray:
        """Exact state at END, exp(L END) y0."""
        return expm_multiply(self.matrix * END, self.start.y)

    def distance(self, y: np.ndarray) -> float:
        """Greatest error of a state at END, relative to the height of the pulse."""
        return np.abs(y - self.exact).max()

    @property
    def band(self) -> tuple[int, int]:
        """Lower and upper bandwidth of L in interleaved order."""
        found = self.matrix[self.mixed][:, self.mixed].tocoo()
        return int((found.row - found.col).max()), int((found.col - found.row).max())

    def _rhs(self):
        """Compiled right-hand side of the model as f(t, y, dydt); it reads its tables and `out` at their addresses."""
        at, slate, out = (
            int(addresses((self.model.functions.rhs,))[0]),
            RunData(self.model),
            self.model.new_out(),
        )
        self._kept, handle = (slate, out), slate.handle
        handle_at, handle_size, out_at, out_size = (
            handle.ctypes.data,
            handle.size,
            out.ctypes.data,
            out.size,
        )

        @numba.njit(error_model="numpy")
        def function(t, y, dydt):
            tables = numba.carray(pointer(handle_at), handle_size, np.int64)
            beside = numba.carray(pointer(out_at), out_size, np.float64)
            call_rhs(at, t, y, dydt, beside, tables)

        return function

    def _rhs_mixed(self):
        """Compiled right-hand side f(t, y, dydt) of interleaved states."""
        rhs, cells = self.rhs, self.cells

        @numba.njit(error_model="numpy")
        def function(t, y, dydt):
            straight, rate = np.empty(2 * cells), np.empty(2 * cells)
            for i in range(cells):
                straight[i], straight[cells + i] = y[2 * i], y[2 * i + 1]
            rhs(t, straight, rate)
            for i in range(cells):
                dydt[2 * i], dydt[2 * i + 1] = rate[i], rate[cells + i]

        return function
