"""Transfer function from any input of a case to any probe, with exact delays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fvsolve.argument_checks import FLAG, NUMBER, TABLE, TEXT, validated
from fvsolve.case import load
from fvsolve.declarations import declared
from fvsolve.studies.loops.delay_system import DelaySystem
from fvsolve.studies.loops.loop import MOST_POLES, frequencies
from fvsolve.studies.loops.open_loop import delayed_system


@dataclass(frozen=True, eq=False)
class InputResponse:
    """Frequency response H(j w) of a probe to an input, SI; fields as `studies.ports.response.Response`.

    input, output : names; units : units of both; system : A, B, C, D with the delays; delays are cut in these
    poles : all poles without delays, else the rightmost ones [1/s]
    """

    case: str
    when: str
    input: str
    output: str
    units: tuple[str, str]
    scheme: str | None
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    system: DelaySystem
    error: float
    poles: np.ndarray
    w: np.ndarray
    h: np.ndarray
    moving: float

    def plain(self) -> dict:
        """Values for JSON with the names of `studies.ports.response.Response`; `port` and `verdict` are None."""
        residues = None if self.system.delays.size else residues_of(self.system, self.poles)
        return {
            "case": self.case,
            "when": self.when,
            "port": None,
            "kind": "response",
            "input": self.input,
            "output": self.output,
            "scheme": self.scheme,
            "input_unit": self.units[0],
            "output_unit": self.units[1],
            "states": self.states,
            "state_units": self.state_units,
            "A": self.system.a,
            "B": self.system.b[:, 0],
            "C": self.system.c[0],
            "D": float(self.system.d[0, 0]),
            "delays": self.system.delays,
            "error": self.error,
            "poles": [[float(s.real), float(s.imag)] for s in self.poles],
            "residues": residues,
            "frequency": self.w,
            "real": self.h.real,
            "imaginary": self.h.imag,
            "moving": self.moving,
            "verdict": None,
        }


def residues_of(system: DelaySystem, poles: np.ndarray) -> list:
    """Residues of H at poles of a system without delays, as [re, im]."""
    from scipy.linalg import eig

    if not poles.size:
        return []
    values, left, right = eig(system.a, left=True, right=True)
    overlap = np.einsum("ij,ij->j", left.conj(), right)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = (system.c[0] @ right) * (left.conj().T @ system.b[:, 0]) / overlap
    order = [int(np.argmin(np.abs(values - pole))) for pole in poles]
    return [[float(found[k].real), float(found[k].imag)] for k in order]


@declared("study")
@validated(input=TEXT, output=TEXT, at=NUMBER, before=FLAG, scheme=TEXT, set=TABLE)
def input_response(
    case,
    input: str,
    output: str,
    at: float | None = None,
    before: bool = False,
    scheme: str | None = None,
    set: Mapping | None = None,
) -> InputResponse:
    """Compute the transfer function from an input of a case to a probe, linearised as by `linearise`.

    input : such as "valve.opening" or "controls.NAME.setpoint"; output : probe; at, before, scheme, set : as for
    `linearise`. A loop is cut at the output of a control that is the input; delays are exact, and sampled controls hold
    their outputs. Raises CaseError, and FvsolveError for an unknown name, a case that cannot be linearised, and more
    than 800 states.
    """
    set = dict(set or {}) | ({} if scheme is None else {"numerics.scheme": scheme})
    linear, system = delayed_system(load(case, set), None, input, output, at, before)
    point = linear.at
    w = frequencies(system, lambda x: system.response(1j * x)[:, 0, 0])
    return InputResponse(
        point.model.case.name,
        point.when,
        input,
        output,
        (linear.input_units[0], linear.output_units[0]),
        point.model.case.numerics.scheme if point.model.cells else None,
        tuple(linear.states),
        tuple(linear.state_units),
        system,
        max(linear.error.values()),
        system.poles(MOST_POLES),
        w,
        system.response(1j * w)[:, 0, 0],
        float(np.max(np.abs(point.rate) / point.model.scale)),
    )
