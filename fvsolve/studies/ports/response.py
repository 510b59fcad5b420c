"""Transfer function at a port of a linearised case: pressure against flow, and whether it is positive real."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fvsolve.doors import FLAG, NUMBER, TABLE, TEXT, door
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.studies.ports.state_space import TOLERANCE, StateVerdict, Transfer, state_positive_real

LARGEST = 800  # states whose Hamiltonian matrix, twice as large, is still taken
DECADE = 200  # frequencies a decade in the table


@dataclass(frozen=True, eq=False)
class Response:
    """dx/dt = A x + B u, y = C x + D u at one port, its frequency response and verdict; SI, deviations.

    kind : "admittance" of a reservoir (u pressure [Pa], y flow into the network [m3/s]) or "impedance" (u flow fed in
    [m3/s], y pressure [Pa]); a : float64[n, n]; b, c : float64[n]; d : float; w : float64[k] [rad/s];
    h : complex128[k]; moving : greatest rate of the state there, by its scale [1/s];
    error : relative one of A, B, C, D, by two steps of the differences
    """

    case: str
    when: str
    port: str
    kind: str
    scheme: str | None
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: float
    error: float
    transfer: Transfer
    w: np.ndarray
    h: np.ndarray
    verdict: StateVerdict
    moving: float

    @property
    def units(self) -> tuple[str, str]:
        """Of u and y."""
        return ("Pa", "m3/s") if self.kind == "admittance" else ("m3/s", "Pa")

    def __call__(self, s):
        """H at complex numbers s [1/s]; a number of a number, an array of an array."""
        found = self.transfer(s)
        return complex(found[0]) if np.ndim(s) == 0 else found

    def plain(self) -> dict:
        """As JSON says it: complex numbers as [re, im]."""
        poles = sorted(
            zip(self.transfer.poles, self.transfer.residues, strict=True), key=lambda p: (abs(p[0]), p[0].imag)
        )
        return {
            "case": self.case, "when": self.when, "port": self.port, "kind": self.kind, "scheme": self.scheme,
            "input_unit": self.units[0], "output_unit": self.units[1], "states": self.states,
            "state_units": self.state_units, "A": self.a, "B": self.b, "C": self.c, "D": self.d, "error": self.error,
            "poles": [[s.real, s.imag] for s, _ in poles], "residues": [[r.real, r.imag] for _, r in poles],
            "frequency": self.w, "real": self.h.real, "imaginary": self.h.imag, "moving": self.moving,
            "verdict": self.verdict.plain(),
        }  # fmt: skip


@door(port=TEXT, at=NUMBER, before=FLAG, scheme=TEXT, set=TABLE)
def response(
    case, port: str, at: float | None = None, before: bool = False, scheme: str | None = None,
    set: Mapping | None = None, frequencies: np.ndarray | None = None,
) -> Response:  # fmt: skip
    """The transfer function between pressure and flow at a node of a case, linearised as `linearise` does.

    port : a reservoir (admittance), or a junction, inflow, chamber or tank (impedance, flow fed in there);
    at, before, scheme : see `linearise`; frequencies : float64[k] [rad/s] of the table. Raises FvsolveError for a port
    that is none, a case that cannot be linearised and one with more than 800 states.
    """
    from fvsolve.case import load

    case = load(case, dict(set or {}))
    if not any(node.domain == "hydraulic" for node in case.places.values()):
        raise FvsolveError(f"{case.name} has no port: nothing in it has a pressure; a reservoir, junction, inflow, "
                           "chamber or tank is one")  # fmt: skip
    if port not in case.places:
        raise FvsolveError(f'no port named "{port}"{did_you_mean(port, case.places)}; ports are {listing(case.places)}')
    system, flows = _linear(case, port, at, before, scheme)
    a, b, c, d = system
    found = flows.at.model
    error = max(flows.error.values())
    transfer = _transfer(flows.at, a, b, c, d, error)
    verdict = state_positive_real(transfer, max(TOLERANCE, 10.0 * error))
    w = _table(verdict, transfer) if frequencies is None else np.asarray(frequencies, float)
    driven = case.places[port].driven
    kind = "admittance" if driven is not None and driven[1] == 0.0 else "impedance"
    return Response(
        case.name, flows.at.when, port, kind, found.case.numerics.scheme if found.cells else None,
        tuple(flows.states), tuple(flows.state_units), a, b, c, d, error, transfer, w, transfer(1j * w), verdict,
        float(np.max(np.abs(flows.at.rate) / found.scale)),
    )  # fmt: skip


def _linear(case, port: str, at, before, scheme):
    """((A, b, c, d), the Linear they are from)."""
    from fvsolve.studies.linear.linearise import linearise

    driven = case.places[port].driven
    asked: Callable = lambda inputs, outputs: linearise(case, inputs, outputs, at, before, scheme)  # noqa: E731
    if driven is not None and driven[1] == 0.0:
        signs = port_flows(case, port)
        found = asked([f"{port}.{driven[0]}"], list(signs))
        weights = np.array(list(signs.values()))
        return (_dense(found.a), found.b[:, 0], weights @ found.c, float(weights @ found.d[:, 0])), found
    pressure = f"nodes.{port}.pressure" if port in case.nodes else f"{port}.pressure"
    if driven is not None:
        key, sign = driven
        found = asked([f"{port}.{key}"], [pressure])
        return (_dense(found.a), sign * found.b[:, 0], found.c[0], sign * float(found.d[0, 0])), found
    found = asked([], [pressure])
    row = found.at.model.tables.nodes[found.at.model.node_names.index(port)]
    b = np.zeros(len(found.states))
    b[row["y"]] = _density(found, row)
    return (_dense(found.a), b, found.c[0], 0.0), found


def port_flows(case, port: str) -> dict[str, float]:
    """Probes whose sum, each with its sign, is the flow from a node into its links [m3/s]."""
    found: dict[str, float] = {}
    for name, link in case.links.items():
        for end, place in link.ports.items():
            if place != port:
                continue
            if link.kind == "pipe":
                found[f"links.{name}.flow@{0 if end == 'from' else 1}"] = 1.0 if end == "from" else -1.0
            elif link.kind == "spool-valve":
                found[f"links.{name}.flow_{end}"] = 1.0
            else:
                found[f"links.{name}.flow"] = 1.0 if end == "from" else -1.0
    return found


def _density(found, row) -> float:
    """Mass per volume fed in at a storing node [kg/m3]."""
    return float(found.at.model.case.law.density(found.output_values[0]))


def _dense(a) -> np.ndarray:
    """A as a full array, before which its size is looked at."""
    if a.shape[0] > LARGEST:
        share = math.floor(100 * LARGEST / a.shape[0])
        raise FvsolveError(f"the case has {a.shape[0]} states, a verdict is found up to {LARGEST}: give its pipes "
                           f"fewer cells, {share} % of what they have, --set links.NAME.cells=...")  # fmt: skip
    return a if isinstance(a, np.ndarray) else a.toarray()


def _transfer(at, a, b, c, d, error: float) -> Transfer:
    """H in coordinates whose square is energy."""
    from fvsolve.model.energy import energy_form

    form = energy_form(at.model, at.y).completed()
    return Transfer(form.seen(a), form.forth @ b, c @ form.back, d, error)


def _table(verdict: StateVerdict, h: Transfer) -> np.ndarray:
    """Frequencies of the table: even in their logarithm, those of poles left of the axis, and the worst of bands."""
    low, high = verdict.low, verdict.high
    grid = np.geomspace(low, high, int(DECADE * np.log10(high / low)) + 1)
    poles = np.abs(h.poles.imag[~np.isin(h.poles, verdict.axis)])
    poles = poles[(low < poles) & (poles < high)]
    return np.unique(np.concatenate([grid, poles, [dip.worst for dip in verdict.dips]]))
