"""Transfer function between pressure and flow at a port of a linearised case, and its positive realness."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.studies.ports.state_space import TOLERANCE, StateVerdict, Transfer, state_positive_real
from fvsolve.validation import FLAG, NUMBER, TABLE, TEXT, validated

MAX_STATES = 800  # greatest number of states; the Hamiltonian matrix is twice as large
POINTS_PER_DECADE = 200  # frequencies per decade in the table


@dataclass(frozen=True, eq=False)
class Response:
    """Linearised case at a port, dx/dt = A x + B u, y = C x + D u, with its frequency response; SI deviations.

    kind : "admittance" of a reservoir (u pressure [Pa], y flow into the network [m3/s]) or "impedance" (u inflow
    [m3/s], y pressure [Pa]); when : state about which the case is linearised
    scheme : scheme in use, None without cells of pipes
    states, state_units : names and units of x
    a : float64[n, n]  A; b, c : float64[n]  B and C; d : D; error : relative error of A, B, C, D
    transfer : transfer function H(s); verdict : result of the test for positive realness
    w : float64[k]  frequencies [rad/s]; h : complex128[k]  H(j w)
    moving : greatest rate of change of a state relative to its scale [1/s]; 0 for a steady state
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
        """Units of the input u and of the output y."""
        return ("Pa", "m3/s") if self.kind == "admittance" else ("m3/s", "Pa")

    def __call__(self, s):
        """Transfer function H at complex numbers s [1/s]; a number for a number, an array for an array."""
        values = self.transfer(s)
        return complex(values[0]) if np.ndim(s) == 0 else values

    def plain(self) -> dict:
        """Values for JSON, arrays as numpy arrays: poles and residues as [re, im], H as `real` and `imaginary`."""
        pairs = zip(self.transfer.poles, self.transfer.residues, strict=True)
        poles = sorted(pairs, key=lambda pair: (abs(pair[0]), pair[0].imag))
        return {
            "case": self.case, "when": self.when, "port": self.port, "kind": self.kind, "scheme": self.scheme,
            "input_unit": self.units[0], "output_unit": self.units[1], "states": self.states,
            "state_units": self.state_units, "A": self.a, "B": self.b, "C": self.c, "D": self.d, "error": self.error,
            "poles": [[s.real, s.imag] for s, _ in poles], "residues": [[r.real, r.imag] for _, r in poles],
            "frequency": self.w, "real": self.h.real, "imaginary": self.h.imag, "moving": self.moving,
            "verdict": self.verdict.plain(),
        }  # fmt: skip


@validated(port=TEXT, at=NUMBER, before=FLAG, scheme=TEXT, set=TABLE)
def response(
    case, port: str, at: float | None = None, before: bool = False, scheme: str | None = None,
    set: Mapping | None = None, frequencies: np.ndarray | None = None,
) -> Response:  # fmt: skip
    """Compute the transfer function between pressure and flow at a node of a case, linearised by `linearise`.

    port : name of a reservoir (for an admittance), or of a junction, inflow, chamber or tank (for an impedance)
    at, before, scheme : time, side of a jump, and linear scheme as in `linearise`; set : changed keys of the case
    frequencies : float64[k]  frequencies of the response [rad/s]; default: 200 in each decade around the poles
    Raises CaseError for an invalid case, and FvsolveError for an invalid port, a case that cannot be linearised, and
    more than 800 states.
    """
    from fvsolve.case import load

    case = load(case, dict(set or {}))
    if not any(node.domain == "hydraulic" for node in case.places.values()):
        raise FvsolveError(f"{case.name} has no port, because no node has a pressure. Expected a reservoir, junction, "
                           "inflow, chamber or tank")  # fmt: skip
    if port not in case.places:
        hint = did_you_mean(port, case.places) or f". Ports are {listing(case.places)}"
        raise FvsolveError(f'no port named "{port}"{hint}')
    system, flows = _linear_system(case, port, at, before, scheme)
    a, b, c, d = system
    model = flows.at.model
    error = max(flows.error.values())
    transfer = _transfer(flows.at, a, b, c, d, error)
    verdict = state_positive_real(transfer, max(TOLERANCE, 10.0 * error))
    w = _frequency_table(verdict, transfer) if frequencies is None else np.asarray(frequencies, float)
    driven = case.places[port].driven
    kind = "admittance" if driven is not None and driven[1] == 0.0 else "impedance"
    return Response(
        case.name, flows.at.when, port, kind, model.case.numerics.scheme if model.cells else None,
        tuple(flows.states), tuple(flows.state_units), a, b, c, d, error, transfer, w, transfer(1j * w), verdict,
        float(np.max(np.abs(flows.at.rate) / model.scale)),
    )  # fmt: skip


def _linear_system(case, port: str, at, before, scheme):
    """((A, b, c, d), `Linear` system from which they are made), with the input and the output at a port.

    port, at, before, scheme : as in `response`
    """
    from fvsolve.studies.linear.linearise import linearise

    driven = case.places[port].driven
    linear: Callable = lambda inputs, outputs: linearise(case, inputs, outputs, at, before, scheme)  # noqa: E731
    if driven is not None and driven[1] == 0.0:
        signs = port_flows(case, port)
        system = linear([f"{port}.{driven[0]}"], list(signs))
        weights = np.array(list(signs.values()))
        return (_dense(system.a), system.b[:, 0], weights @ system.c, float(weights @ system.d[:, 0])), system
    pressure = f"nodes.{port}.pressure" if port in case.nodes else f"{port}.pressure"
    if driven is not None:
        key, sign = driven
        system = linear([f"{port}.{key}"], [pressure])
        return (_dense(system.a), sign * system.b[:, 0], system.c[0], sign * float(system.d[0, 0])), system
    system = linear([], [pressure])
    row = system.at.model.tables.nodes[system.at.model.node_names.index(port)]
    b = np.zeros(len(system.states))
    b[row["y"]] = float(system.at.model.case.law.density(system.output_values[0]))  # at the pressure of the port
    return (_dense(system.a), b, system.c[0], 0.0), system


def port_flows(case, port: str) -> dict[str, float]:
    """Signs with which probes add up to the flow from a node into its links [m3/s]: name of the probe -> 1 or -1."""
    signs: dict[str, float] = {}
    for name, link in case.links.items():
        for end, node in link.ports.items():
            if node != port:
                continue
            if link.kind == "pipe":
                signs[f"links.{name}.flow@{0 if end == 'from' else 1}"] = 1.0 if end == "from" else -1.0
            elif link.kind == "spool-valve":
                signs[f"links.{name}.flow_{end}"] = 1.0
            else:
                signs[f"links.{name}.flow"] = 1.0 if end == "from" else -1.0
    return signs


def _dense(a) -> np.ndarray:
    """Matrix A as a full array; raises FvsolveError for more than 800 states."""
    if a.shape[0] > MAX_STATES:
        percent = math.floor(100 * MAX_STATES / a.shape[0])
        raise FvsolveError(f"the case has {a.shape[0]} states. Expected {MAX_STATES} or fewer. Reduce the cells of its "
                           f"pipes to {percent} %: --set links.NAME.cells=...")  # fmt: skip
    return a if isinstance(a, np.ndarray) else a.toarray()


def _transfer(at, a, b, c, d, error: float) -> Transfer:
    """Transfer function of the state space A, b, c, d, with A, b, c converted to coordinates of the energy norm.

    at : operating point; error : relative error of A, b, c, d
    """
    from fvsolve.model.energy_norm import energy_form

    form = energy_form(at.model, at.y).full_norm()
    return Transfer(form.seen(a), form.forward @ b, c @ form.back, d, error)


def _frequency_table(verdict: StateVerdict, h: Transfer) -> np.ndarray:
    """Frequencies of the response [rad/s] : float64[k], in increasing order.

    They are a logarithmic grid, and two kinds of additional frequencies. These are |Im s| of each pole s off the
    imaginary axis, if it is within the grid, and the frequency of the least Re H / |H| in each frequency band with Re H
    < 0.
    """
    low, high = verdict.low, verdict.high
    grid = np.geomspace(low, high, int(POINTS_PER_DECADE * np.log10(high / low)) + 1)
    poles = np.abs(h.poles.imag[~np.isin(h.poles, verdict.axis)])
    poles = poles[(low < poles) & (poles < high)]
    return np.unique(np.concatenate([grid, poles, [dip.worst for dip in verdict.dips]]))
