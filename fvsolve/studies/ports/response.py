"""Transfer function at a port of a linearised case, and test of a state-space system for positive realness.

The test is in floating point, up to a tolerance.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fvsolve.argument_checks import (
    COMPLEX,
    FLAG,
    MATRIX,
    NUMBER,
    POSITIVE,
    SERIES,
    TABLE,
    TEXT,
    instance_of,
    validated,
)
from fvsolve.core.output.result_table import PlainData
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError, did_you_mean, listing

# values of Re H / |H| closer to zero are undecided, because of differences and rounding
TOLERANCE = 1e-9
# searched below the slowest and above the fastest pole; more if Re H changes sign beyond
DECADES = 1.0
FARTHEST = 1e4  # ratio to the slowest and fastest pole beyond which a change of sign is rounding
GRID = 40  # frequencies per decade, in addition to those at which Re H can change sign
# distance to a pole on the axis, in shifts, within which Re H is not linear in Re s
POLE_DISTANCE = 100.0
# distances of frequencies from a pole on the axis, in shifts
POLE_NEIGHBOURS = np.concatenate(
    [-np.geomspace(100.0, 0.01, 13), [0.0], np.geomspace(0.01, 100.0, 13)]
)
ROUNDING = 1e-13  # rounding error of H relative to the sum of absolute terms
# a mode is hidden if its residue is below this fraction of the bound from norms of B and C
HIDDEN_RESIDUE = 1e-10
DEFECT = 1e-7  # greatest error of a pole relative to the norm of A, also for defective poles


@declared("study")
class Transfer:
    """Transfer function H(s) = D + C (s - A)^-1 B with a single input and output, by a Schur form of the balanced A.

    a, b, c, d : float64[n, n], float64[n], float64[n], float  matrices A, B, C, D; the attributes of these names
    contain the balanced matrices
    error : relative error of A
    poles : complex128[n]  poles [1/s]; residues : complex128[n]  their residues
    pole_error : float64[n]  errors of the poles due to rounding and `error` [1/s]
    visible : bool[n]  True if the residue of the pole is not zero, so that H shows it
    Raises FvsolveError for matrices of sizes that do not match.
    """

    @validated(a=MATRIX, b=SERIES, c=SERIES, d=NUMBER, error=NUMBER)
    def __init__(self, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: float, error: float = 0.0):
        from scipy.linalg import matrix_balance, schur

        sizes = (*np.shape(a), np.size(b), np.size(c))
        if len({*sizes}) > 1:
            sizes_text = (
                f"A of {sizes[0]} x {sizes[1]}, {sizes[2]} numbers in B and {sizes[3]} in C"
            )
            raise FvsolveError(f"{sizes_text} do not match; expected n x n, n and n")
        self.error = float(error)
        self.a, self.b, self.c, self.d = (np.asarray(x, float) for x in (a, b, c, d))
        if self.a.size:
            self.a, (scale, _) = matrix_balance(self.a, permute=False, separate=True)
            self.b, self.c = self.b / scale, self.c * scale
        self.t, q = schur(self.a, output="complex") if self.a.size else (self.a, self.a)
        self.left, self.right = self.c @ q, q.conj().T @ self.b
        self.poles, self.residues, self.pole_error, self.visible = self._modes()

    def _modes(self) -> tuple[np.ndarray, ...]:
        from scipy.linalg import eig

        if not self.a.size:
            return np.zeros(0, complex), np.zeros(0, complex), np.zeros(0), np.zeros(0, bool)
        poles, left, right = eig(self.a, left=True, right=True)
        overlap = np.einsum("ij,ij->j", left.conj(), right)
        overlap[np.abs(overlap) < 1e-300] = 1e-300  # a defective pole has overlap 0
        norm = np.linalg.norm(self.a, 2)
        moved = (10 * len(poles) * np.finfo(float).eps + self.error) * norm / np.abs(overlap)
        residues = (self.c @ right) * (left.conj().T @ self.b) / overlap
        most = np.linalg.norm(self.b) * np.linalg.norm(self.c) / np.abs(overlap)
        return (
            poles,
            residues,
            np.minimum(moved, DEFECT * norm),
            np.abs(residues) > HIDDEN_RESIDUE * most,
        )

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """Transfer function H at complex numbers s [1/s] : complex128[k]; infinity at a pole."""
        return self.evaluate(s)[0]

    @validated(s=COMPLEX)
    def evaluate(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Transfer function H at complex numbers s [1/s] : complex128[k], and its error : float64[k].

        The error contains rounding and the error of A.
        """
        s = np.atleast_1d(np.asarray(s, complex))
        n = len(self.poles)
        x, diagonal = np.zeros((n, s.size), complex), np.diag(self.t)
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in reversed(range(n)):
                x[i] = (self.right[i] + self.t[i, i + 1 :] @ x[i + 1 :]) / (s - diagonal[i])
            values = self.d + self.left @ x
            size = abs(self.d) + np.abs(self.left) @ np.abs(x)
        finite = np.isfinite(values)
        return np.where(finite, values, np.inf), np.where(
            finite, (ROUNDING + self.error) * size, np.inf
        )

    @validated(s=COMPLEX)
    def angle(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cosine of the phase of H, Re H / |H|, at complex numbers s [1/s] : float64[k], and its error : float64[k].

        The results are 1 and 0 at a pole and where H = 0.
        """
        value, doubt = self.evaluate(s)
        size = np.abs(value)
        finite = np.isfinite(size) & (size > 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(finite, value.real / size, 1.0), np.where(finite, doubt / size, 0.0)


@dataclass(frozen=True)
class Dip:
    """Interval of frequencies low < w < high [rad/s] with Re H < 0.

    An interval that contains the first or last tested frequency has the end 0 or infinity.
    worst : frequency of the least Re H / |H| [rad/s]; real, angle : Re H and Re H / |H| there
    """

    low: float
    high: float
    worst: float
    real: float
    angle: float


@dataclass(frozen=True)
class StateVerdict(PlainData):
    """Result of `state_positive_real` for a transfer function H(s).

    positive_real : True, False, or None if undecided within the tolerance; reasons : texts
    margin : least Re H / |H|, the cosine of the phase, at the frequency `worst` [rad/s]; with poles on the imaginary
    axis it is extrapolated to the axis from the line Re s = `shift` [1/s]
    tolerance : values of Re H / |H| closer to zero are undecided; low, high : range of frequencies searched [rad/s]
    dips : intervals of frequencies with Re H < 0; axis : poles on the imaginary axis within their errors [1/s]
    unstable : poles right of the axis that H shows [1/s]; hidden : poles right of the axis that H does not show [1/s]
    """

    positive_real: bool | None
    reasons: tuple[str, ...]
    margin: float
    worst: float
    tolerance: float
    shift: float
    low: float
    high: float
    dips: tuple[Dip, ...]
    unstable: tuple[complex, ...]
    axis: tuple[complex, ...]
    hidden: tuple[complex, ...]

    also = ("reason", "answer")

    @property
    def reason(self) -> str:
        """All reasons in a single text."""
        return "; ".join(self.reasons)

    @property
    def answer(self) -> str:
        """Text "yes" or "no", or "undecided within" followed by the tolerance."""
        return {True: "yes", False: "no", None: f"undecided within {self.tolerance:.0e}"}[
            self.positive_real
        ]


@declared("study")
@validated(h=instance_of(Transfer), tolerance=POSITIVE)
def state_positive_real(h: Transfer, tolerance: float = TOLERANCE) -> StateVerdict:
    """Test if a transfer function H is positive real, from the sign of Re H between all points where it can change.

    Re H(jw) = 0 only if jw is an eigenvalue of the Hamiltonian matrix of A, B, C, D (Boyd, Balakrishnan, Kabamba 1989),
    so that no interval between samples is missed. With poles on the imaginary axis, Re H is evaluated on a line
    slightly right of it, where a pole of higher order, or with a residue that is not positive, makes Re H negative.
    tolerance : values of Re H / |H| closer to zero are undecided
    """
    size = np.abs(h.poles)
    reach = h.pole_error + 1e-12 * size
    near = np.abs(h.poles.real) <= reach
    slow, quick = _rate_range(h, size[size > reach])
    shift = float(max(4.0 * np.max(reach[near]), 1e-9 * slow)) if near.any() else 0.0
    w, low, high = frequencies(h, h.poles[near], shift, slow, quick)
    raw, doubt = h.angle(shift + 1j * w)
    zero = not np.any(h(shift + 1j * w))
    right = h.poles.real > reach
    unstable, hidden = h.poles[right & h.visible], h.poles[right & ~h.visible]
    dips = _dips(h, shift, w, _certain_part(raw, doubt), tolerance)
    margin, worst = (
        (0.0, 0.0) if zero else _margin(h, near, shift, w, raw, doubt, (low <= w) & (w <= high))
    )
    holds = False if len(unstable) or dips else True if margin > tolerance or zero else None
    reasons = tuple(_reason_texts(holds, unstable, dips, hidden, margin, worst, tolerance, shift))
    return StateVerdict(
        holds,
        reasons,
        margin,
        worst,
        tolerance,
        shift,
        low,
        high,
        tuple(dips),
        _listed(unstable),
        _listed(h.poles[near]),
        _listed(hidden),
    )


def _margin(h, near, shift, w, raw, doubt, within) -> tuple[float, float]:
    """Least Re H / |H|, moved towards zero by its error, and its frequency [rad/s].

    Frequencies near poles on the imaginary axis are left out.
    h : transfer function H; near : True for each pole on the imaginary axis
    shift : real part of the line of the samples [1/s], from which the value is extrapolated to the axis
    w : frequencies of the samples [rad/s]; raw, doubt : result of `Transfer.angle` there
    within : True for each frequency in the searched range
    """
    angle = _certain_part(raw, doubt)
    if shift:
        within = within & (
            np.min(np.abs(w[:, None] - np.abs(h.poles.imag[near])), axis=1) > POLE_DISTANCE * shift
        )
        angle = _certain_part(2.0 * raw - h.angle(2.0 * shift + 1j * w)[0], 3.0 * doubt)
    k = int(np.argmin(np.where(within, angle, np.inf)))
    return float(angle[k]), float(w[k])


def _certain_part(angle: np.ndarray, doubt: np.ndarray) -> np.ndarray:
    return np.sign(angle) * np.maximum(np.abs(angle) - doubt, 0.0)


def _rate_range(h: Transfer, size: np.ndarray) -> tuple[float, float]:
    """Slowest and fastest rate of the transfer function h [1/s], from the sizes of its poles that are not 0.

    If all poles are 0, both are the corner frequency |C B / D|, or 1 without it.
    """
    if len(size):
        return float(size.min()), float(size.max())
    corner = abs(h.c @ h.b / h.d) if h.d else 0.0
    return (corner, corner) if corner > 0.0 else (1.0, 1.0)


def frequencies(h: Transfer, near: np.ndarray, shift: float, slow: float, quick: float):
    """Frequencies to be tested, in increasing order : float64[k], and the range low, high that they cover [rad/s].

    They include all frequencies at which Re H can change sign, so that no interval with Re H < 0 is missed.
    near : poles on the imaginary axis; frequencies are added around them, also below `low`
    shift : real part of the line on which Re H is tested [1/s]; slow, quick : slowest and fastest rate of H [1/s]
    """
    zeros = crossings(h.a - shift * np.eye(len(h.poles)), h.b, h.c, float(h.d))
    # imaginary eigenvalues: changes of sign
    real = np.abs(zeros.imag[np.abs(zeros.real) <= 1e-6 * np.abs(zeros)])
    real = real[(slow / FARTHEST < real) & (real < quick * FARTHEST)]
    low = min(slow * 10.0**-DECADES, np.min(real, initial=np.inf) / 3.0)
    high = max(quick * 10.0**DECADES, np.max(real, initial=0.0) * 3.0)
    marks = np.concatenate([np.abs(h.poles.imag), np.abs(zeros.imag)])
    count = max(2, int(GRID * np.log10(high / low)))
    neighbours = (np.abs(near.imag)[:, None] + shift * POLE_NEIGHBOURS).ravel()
    parts = [
        np.geomspace(low, high, count),
        marks[(low < marks) & (marks < high)],
        neighbours[neighbours >= 0.0],
    ]
    marks = np.unique(np.concatenate(parts))
    return (
        np.unique(np.concatenate([marks, np.sqrt(marks[1:] * marks[:-1])])),
        float(low),
        float(high),
    )


def crossings(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: float) -> np.ndarray:
    """Complex numbers that include all jw with Re H(jw) = 0 : complex128[k], not sorted; a, b, c, d : state space.

    They are eigenvalues of the Hamiltonian matrix. If D is zero, 1 / H without its part s / (C B), which grows to
    infinity, is used in place of H, because Re 1/H has the sign of Re H. If C B is zero too, the result is empty:
    then H is not positive real unless H = 0.
    """
    n = len(a)
    if n == 0:
        return np.zeros(0, complex)
    flow = np.linalg.norm(b) * np.linalg.norm(c)
    if abs(d) * np.linalg.norm(a) > 1e-13 * flow:
        first = a - np.outer(b, c) / (2.0 * d)
        matrix = np.block(
            [[first, -np.outer(b, b) / (2.0 * d)], [np.outer(c, c) / (2.0 * d), -first.T]]
        )
        return np.linalg.eigvals(matrix)
    gain = float(c @ b)
    if abs(gain) <= 1e-13 * flow:
        # relative degree two or more: not positive real; Re H < 0 or H = 0 at high w
        return np.zeros(0, complex)
    inside = np.linalg.svd(c[None, :])[2][1:].T  # null space of the output
    follow = inside.T - np.outer(inside.T @ b, c) / gain
    return crossings(
        follow @ a @ inside,
        follow @ a @ b / gain,
        -(c @ a @ inside) / gain,
        -float(c @ a @ b) / gain**2,
    )


def _dips(h, shift, w, angle, tolerance) -> list[Dip]:
    """Intervals of the frequencies w in which Re H / |H| (`angle`) is below -tolerance, with refined ends.

    h : transfer function H; shift : real part of the line of the samples [1/s]
    """
    negative = angle < -tolerance
    edges = np.flatnonzero(np.diff(np.concatenate([[False], negative, [False]]).astype(int)))
    dips = []
    for start, stop in zip(edges[0::2], edges[1::2], strict=True):
        worst = start + int(np.argmin(angle[start:stop]))
        low = _edge(h, shift, w[start - 1], w[start]) if start else 0.0
        high = _edge(h, shift, w[stop], w[stop - 1]) if stop < len(w) else np.inf
        dips.append(
            Dip(
                low,
                high,
                float(w[worst]),
                float(h(shift + 1j * w[worst])[0].real),
                float(angle[worst]),
            )
        )
    return dips


def _edge(h, shift, good: float, bad: float) -> float:
    """Frequency [rad/s] of the sign change of Re H on Re s = shift, bisected between `good` (Re H >= 0) and `bad`."""
    for _ in range(60):
        middle = 0.5 * (good + bad)
        if middle in (good, bad):
            break
        good, bad = (good, middle) if h(shift + 1j * middle)[0].real < 0.0 else (middle, bad)
    return float(bad)


def _listed(poles: np.ndarray) -> tuple[complex, ...]:
    return tuple(complex(s) for s in sorted(poles, key=lambda s: (-s.real, abs(s.imag), -s.imag)))


def _reason_texts(holds, unstable, dips, hidden, margin, worst, tolerance, shift) -> list[str]:
    texts = []
    if len(unstable):
        texts.append(
            f"{_poles(unstable)} in the right half plane, greatest Re s at s = {_listed(unstable)[0]:.6g} 1/s"
        )
    for dip in dips[:8]:
        high = f"< {dip.high:.9g}" if np.isfinite(dip.high) else "to infinity"
        texts.append(
            f"Re H < 0 for {dip.low:.9g} < w {high} rad/s, least Re H / |H| = {dip.angle:.4g} "
            f"at w = {dip.worst:.9g} rad/s"
        )
    if len(dips) > 8:
        texts.append(f"and in {len(dips) - 8} more bands")
    where = f"for Re s >= {shift:.3g} 1/s (H has poles on the axis)" if shift else "on the axis"
    if holds and worst == 0.0:
        texts.append("H = 0")
    elif holds:
        texts.append(
            f"no pole in the right half plane, Re H > 0 {where}: least {margin:.4g} |H| in the searched "
            f"range, at w = {worst:.6g}; Re H does not change sign outside this range"
        )
    elif holds is None:
        texts.append(
            f"at the limit of positive realness: Re H >= -{tolerance:.0e} |H| at every w {where}, "
            f"and within {tolerance:.0e} |H| of zero at w = {worst:.6g} ({margin:.1e}), "
            "as for a lossless system"
        )
    if len(hidden):
        texts.append(
            f"hidden: {_poles(hidden)} in the right half plane that H does not show, "
            f"greatest Re s at s = {_listed(hidden)[0]:.6g} 1/s"
        )
    return texts


def _poles(poles) -> str:
    return "a pole" if len(poles) == 1 else f"{len(poles)} poles"


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
            "case": self.case,
            "when": self.when,
            "port": self.port,
            "kind": self.kind,
            "scheme": self.scheme,
            "input_unit": self.units[0],
            "output_unit": self.units[1],
            "states": self.states,
            "state_units": self.state_units,
            "A": self.a,
            "B": self.b,
            "C": self.c,
            "D": self.d,
            "error": self.error,
            "poles": [[s.real, s.imag] for s, _ in poles],
            "residues": [[r.real, r.imag] for _, r in poles],
            "frequency": self.w,
            "real": self.h.real,
            "imaginary": self.h.imag,
            "moving": self.moving,
            "verdict": self.verdict.plain(),
        }


@declared("study")
@validated(port=TEXT, at=NUMBER, before=FLAG, scheme=TEXT, set=TABLE)
def response(
    case,
    port: str,
    at: float | None = None,
    before: bool = False,
    scheme: str | None = None,
    set: Mapping | None = None,
    frequencies: np.ndarray | None = None,
) -> Response:
    """Compute the transfer function between pressure and flow at a node of a case, linearised by `linearise`.

    port : name of a reservoir (for an admittance), or of a junction, inflow, chamber or tank (for an impedance)
    at, before, scheme : time, side of a jump, and linear scheme as in `linearise`; set : changed keys of the case
    frequencies : float64[k]  frequencies of the response [rad/s]; default: 200 in each decade around the poles
    Raises CaseError for an invalid case, and FvsolveError for an invalid port, a case that cannot be linearised, and
    more than 800 states.
    """
    from fvsolve.case import load
    from fvsolve.core.model.energy_norm import energy_form

    case = load(case, dict(set or {}))
    if not any(node.domain == "hydraulic" for node in case.places.values()):
        raise FvsolveError(
            f"{case.name} has no port, because no node has a pressure; expected a reservoir, junction, "
            "inflow, chamber or tank"
        )
    if port not in case.places:
        hint = did_you_mean(port, case.places) or f". Ports are {listing(case.places)}"
        raise FvsolveError(f'no port named "{port}"{hint}')
    basin = port.partition(".")[0]
    if (
        basin != port
        and getattr(case.nodes.get(basin), "kind", "") == "basin"
        and not port_flows(case, port)
    ):
        raise FvsolveError(
            f"{port} joins no link, so nothing can flow into it there; expected a patch with a link; "
            "the inputs and outputs of a driven patch are given by: fvsolve linearise"
        )
    system, flows = _linear_system(case, port, at, before, scheme)
    a, b, c, d = system
    model = flows.at.model
    error = max(flows.error.values())
    form = energy_form(model, flows.at.y).full_norm()
    transfer = Transfer(form.seen(a), form.forward @ b, c @ form.back, d, error)
    verdict = state_positive_real(transfer, max(TOLERANCE, 10.0 * error))
    w = np.asarray(frequencies, float) if frequencies is not None else None
    # a logarithmic grid, |Im s| of the poles off the imaginary axis, and the worst frequency of each dip
    if w is None:
        low, high = verdict.low, verdict.high
        grid = np.geomspace(low, high, int(POINTS_PER_DECADE * np.log10(high / low)) + 1)
        poles = np.abs(transfer.poles.imag[~np.isin(transfer.poles, verdict.axis)])
        poles = poles[(low < poles) & (poles < high)]
        w = np.unique(np.concatenate([grid, poles, [dip.worst for dip in verdict.dips]]))
    driven = case.places[port].driven
    kind = "admittance" if driven is not None and driven[1] == 0.0 else "impedance"
    return Response(
        case.name,
        flows.at.when,
        port,
        kind,
        model.case.numerics.scheme if model.cells else None,
        tuple(flows.states),
        tuple(flows.state_units),
        a,
        b,
        c,
        d,
        error,
        transfer,
        w,
        transfer(1j * w),
        verdict,
        float(np.max(np.abs(flows.at.rate) / model.scale)),
    )


def _linear_system(case, port: str, at, before, scheme):
    """((A, b, c, d), `Linear` system from which they are made) for a port; arguments as for `response`."""
    from fvsolve.studies.linearise import linearise

    driven = case.places[port].driven
    linear: Callable = lambda inputs, outputs: linearise(case, inputs, outputs, at, before, scheme)  # noqa: E731
    if driven is not None and driven[1] == 0.0:
        signs = port_flows(case, port)
        system = linear([f"{port}.{driven[0]}"], list(signs))
        weights = np.array(list(signs.values()))
        return (
            _dense(system.a),
            system.b[:, 0],
            weights @ system.c,
            float(weights @ system.d[:, 0]),
        ), system
    pressure = f"nodes.{port}.pressure" if port in case.nodes else f"{port}.pressure"
    if driven is not None:
        key, sign = driven
        system = linear([f"{port}.{key}"], [pressure])
        return (
            _dense(system.a),
            sign * system.b[:, 0],
            system.c[0],
            sign * float(system.d[0, 0]),
        ), system
    system = linear([], [pressure])
    row = system.at.model.tables.nodes[system.at.model.node_names.index(port)]
    b = np.zeros(len(system.states))
    # at the pressure of the port
    b[row["y"]] = float(system.at.model.case.law.density(system.output_values[0]))
    return (_dense(system.a), b, system.c[0], 0.0), system


def port_flows(case, port: str) -> dict[str, float]:
    """Signs with which probes add up to the flow from a node into its links [m3/s]: name of the probe -> 1 or -1."""
    signs: dict[str, float] = {}
    for name, link in case.links.items():
        for end, node in link.ports.items():
            if node != port:
                continue
            if link.kind == "pipe":
                signs[f"links.{name}.flow@{0 if end == 'from' else 1}"] = (
                    1.0 if end == "from" else -1.0
                )
            elif f"flow_{end}" in link.quantities:
                signs[f"links.{name}.flow_{end}"] = 1.0
            else:
                signs[f"links.{name}.flow"] = 1.0 if end == "from" else -1.0
    return signs


def _dense(a) -> np.ndarray:
    """Matrix A as a full array; raises FvsolveError for more than 800 states."""
    if a.shape[0] > MAX_STATES:
        percent = math.floor(100 * MAX_STATES / a.shape[0])
        raise FvsolveError(
            f"the case has {a.shape[0]} states; expected {MAX_STATES} or fewer; reduce the cells of its "
            f"pipes to {percent} %: --set links.NAME.cells=..."
        )
    return a if isinstance(a, np.ndarray) else a.toarray()
