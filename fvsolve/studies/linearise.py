"""State-space form of a case about a state: matrices A, B, C, D with names and SI units, and eigenvalues (poles)."""

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fvsolve.argument_checks import FLAG, NAMES, NUMBER, TABLE, TEXT, validated
from fvsolve.core.assembly.lowering import PRESSURE, Input
from fvsolve.core.model.energy_norm import EnergyForm
from fvsolve.core.model.model import inputs_of
from fvsolve.core.output.result_table import Column
from fvsolve.core.schemes import SCHEMES
from fvsolve.core.solve.held_inputs import hold, input_value
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.features.controls.feature import blocks_of
from fvsolve.studies.operating_point import (
    COARSE_STEPS,
    SLOPE_TOLERANCE,
    OperatingPoint,
    has_limiter,
    longest_step_slopes,
    operating_point,
    output_matrix,
    responses,
    single_sided_differences,
    state_matrix,
    two_sided_differences,
)
from fvsolve.units import DIMENSIONS

STATE_UNITS = {
    **dict.fromkeys(("mass", "excess", "air"), "kg"),
    **dict.fromkeys(("forward", "backward", "memory", "flow", "creep"), "kg/s"),
    **dict.fromkeys(("position", "travel"), "m"),
    **dict.fromkeys(("velocity", "travel_rate"), "m/s"),
    **dict.fromkeys(("speed", "opening", "eta", "eps_x", "eps_y", "eps_z"), "-"),
    "angle": "rad",
    "rate": "rad/s",
    **{f"spin_{axis}": "rad/s" for axis in "xyz"},
    **{f"centre_{axis}": "m" for axis in "xyz"},
    **{f"centre_v{axis}": "m/s" for axis in "xyz"},
}


@declared("study")
@dataclass(frozen=True, eq=False)
class Linear:
    """Linear system dx/dt = A x + B u, y = C x + D u for deviations of states x, inputs u, outputs y from a state; SI.

    These are equations (9) and (10) of docs/course.md; the constant rate `at.rate` of a state that is not steady is
    left out. at : operating point
    a : float64[n, n]  A, or a sparse scipy array if n > 1000; b : float64[n, inputs]  B; c : float64[outputs, n]  C
    d : float64[outputs, inputs]  D; input_values, output_values : values at the operating point
    error : {"A", "C" or "BD" : greatest error of an entry of A, of C, and of B and D}
    The error of an entry is the difference of its difference quotients with two steps. In A and C it is relative to the
    sum of |entry| times small deviation over its row, in B and D to the quotient itself.
    """

    at: OperatingPoint
    a: Any
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    input_values: tuple[float, ...]
    output_values: tuple[float, ...]
    error: dict[str, float]

    @property
    def states(self) -> list[str]:
        """Names of the states x."""
        return list(self.at.model.state_names)

    @property
    def state_units(self) -> list[str]:
        """SI units of the states x."""
        names, model = set(self.states), self.at.model
        meshed = {part.name: part.part.physics_type.states for part in model.meshed}
        units = []
        for name in self.states:
            part, quantity = name.rsplit(".", 1)
            plain = quantity.rstrip("0123456789[]")
            if part in meshed:
                units.append(meshed[part].get(quantity.split("[")[0], "-"))
            elif part.startswith("controls."):
                # an integral of a block has the unit of its output, other states of blocks that of its input
                first, output = model.case.controls[part.removeprefix("controls.")].dimensions
                units.append(DIMENSIONS[output if quantity == "integral" else first].si)
            elif plain == "speed" and f"{part}.opening" in names:
                units.append("1/s")  # rate of the opening
            else:
                amount = "kg/m" if name.endswith("]") else "kg"  # of a scalar, times its own unit
                units.append(STATE_UNITS.get(plain, amount))
        return units

    @property
    def sparse(self) -> bool:
        """True if A is a scipy sparse array."""
        return not isinstance(self.a, np.ndarray)

    def plain(self) -> dict:
        """Data for JSON; a sparse A as rows, columns and values."""
        a = self.a
        if self.sparse:
            entries = a.tocoo()
            a = {"row": entries.row, "column": entries.col, "value": entries.data}
        return {
            "case": self.at.model.case.name,
            "at": self.at.t,
            "when": self.at.when,
            "scheme": self.at.model.case.numerics.scheme
            if self.at.model.cells or self.at.model.meshed
            else None,
            "states": self.states,
            "state_units": self.state_units,
            "inputs": self.inputs,
            "input_units": self.input_units,
            "input_values": self.input_values,
            "outputs": self.outputs,
            "output_units": self.output_units,
            "output_values": self.output_values,
            "A": a,
            "B": self.b,
            "C": self.c,
            "D": self.d,
            "error": self.error,
            "state": self.at.y,
            "rate": self.at.rate,
        }


@declared("study")
@validated(inputs=NAMES, outputs=NAMES, at=NUMBER, before=FLAG, scheme=TEXT, set=TABLE)
def linearise(
    case,
    inputs=(),
    outputs=None,
    at: float | None = None,
    before: bool = False,
    scheme: str | None = None,
    set=None,
) -> Linear:
    """Linearise a case by central differences at its start, or at the time `at` [s], with schedules held constant.

    inputs : names such as "valve.opening", "lake.pressure"; outputs : probes; default: the probes of the case
    before : True to hold schedules at the values just before a kink or jump at this time
    scheme : linear scheme that replaces the scheme of the case; set : changed keys of the case
    Delay lines are replaced by cells. Differences are one-sided for an input at the end of its range. Raises CaseError,
    and FvsolveError for an unknown name, a state without a derivative (a limited scheme, a valve at a drop of zero, a
    kink), a case without states, and a run that does not reach `at`.
    """
    set = dict(set or {}) | ({} if scheme is None else {"numerics.scheme": scheme})
    point = operating_point(case, set, at, before, outputs or ())
    return linearise_at(
        point, inputs, len(outputs) if outputs is not None else len(point.model.probes)
    )


def linearise_at(
    at: OperatingPoint, inputs=(), outputs: int = 0, hold_delays: bool = False
) -> Linear:
    """Linearise about an operating point, with named inputs; outputs are the first `outputs` of its probes.

    hold_delays : True to hold the outputs of delays, for step limits; else a delay that is not an input is refused
    A loop is cut at the output of a control that is an input: its probe is then the output as the control computes it.
    Raises FvsolveError for an unknown input, and for a state, input or output without a derivative.
    """
    model, inputs = at.model, tuple(dict.fromkeys(inputs))
    available = inputs_of(model)
    for name in inputs:
        if name not in available:
            hint = did_you_mean(name, available) or f"; inputs are {listing(available)}"
            raise FvsolveError(f'no input named "{name}"{hint}')
    refuse_limiter(model)
    controls = blocks_of(model)
    delays = [f"controls.{model.block_names[k]}" for k in np.flatnonzero(controls["delay"] > 0.0)]
    uncut = [name for name in delays if f"{name}.output" not in inputs]
    if uncut and not hold_delays:
        text = f"{listing(uncut)} of type delay needs earlier inputs, so no matrix A describes it"
        raise FvsolveError(f'{text}; cut the loop there, with the input "{uncut[0]}.output"')
    cut = {
        name: value_of_input(at, available[name])
        for name in inputs
        if available[name].held is not None
    }
    at = replace(at, model=hold(model, cut))
    a, size, error_a, steps = state_matrix(at)
    c, error_c = output_matrix(at, outputs, steps)
    values = [value_of_input(at, available[name]) for name in inputs]
    columns = [
        input_column(at, name, available[name], value, size, outputs, steps)
        for (name, value) in zip(inputs, values, strict=True)
    ]
    n = model.y_size
    bd = np.array([column for column, _ in columns]).reshape(len(inputs), model.y_size + outputs).T
    error = max((error for _, error in columns), default=0.0)
    probes = model.case.probes[:outputs]
    return Linear(
        at,
        a,
        bd[:n].copy(),
        c,
        bd[n:].copy(),
        inputs,
        tuple(probe.text for probe in probes),
        tuple(available[name].sort.unit for name in inputs),
        tuple(probe.unit or DIMENSIONS[probe.dimension].si for probe in probes),
        tuple(values),
        tuple(responses(at, at.y, outputs)[n:].tolist()),
        {"A": error_a, "C": error_c, "BD": error},
    )


def refuse_limiter(model) -> None:
    """Raise FvsolveError if the model uses a limited scheme, which has no derivative where the state is constant."""
    scheme, schemes = model.case.numerics.scheme, model.case.schemes
    if has_limiter(model):
        linear = "upwind"
        if model.meshed and all(part.is_grid for part in model.meshed):
            linear = "upwind or upwind5"
        elif "upwind5" in schemes and not model.meshed:
            linear = (
                f"{SCHEMES[scheme].twin} (equals {scheme} in smooth solutions), upwind or upwind5"
            )
        raise FvsolveError(
            f"numerics.scheme = {scheme} is limited: it has no derivative where the state is constant, however small "
            f"the deviation; linearise with a linear scheme, --scheme {linear}"
        )


def value_of_input(at: OperatingPoint, input_: Input) -> float:
    """Value of an input at the operating point, in SI units."""
    if input_.held is not None:
        return float(at.outputs[input_.held[1]])
    return input_value(at.model, at.t, at.y, input_)


def input_column(at, name, input_, value, size, outputs, steps) -> tuple[np.ndarray, float]:
    """Column of B, followed by the column of D, of an input : float64[n + outputs], and its error.

    at : operating point; name, input_ : name and data of the input; value : its value at the operating point
    size : float64[n]  size of each row of A; outputs : number of outputs; steps : factors on the small change
    Differences are one-sided if the value is at an end of the range of the input. Raises FvsolveError if the effect of
    the input has no derivative.
    """
    model = at.model
    usual = input_.sort.small / (input_.scale or 1e4) if input_.node >= 0 else input_.sort.small
    width = np.array(
        [usual if input_.sort.bounded or input_.sort is PRESSURE else max(usual, abs(value))]
    )
    low, high = input_.sort.least, input_.sort.greatest
    differences = two_sided_differences
    if input_.sort.bounded:
        steps = np.concatenate([COARSE_STEPS, steps])
    if value <= low or value >= high:
        differences, width = single_sided_differences, width if value <= low else -width
    elif input_.sort.bounded:
        width = np.minimum(width, min(value - low, high - value))

    def at_input(u: np.ndarray) -> np.ndarray:
        changed = replace(at, model=hold(model, {name: float(u[0])}))
        return responses(changed, at.y, outputs)

    x = np.array([value])
    sides = differences(at_input, x, width, at_input(x), steps)
    slope, error, kink = longest_step_slopes(
        *sides, np.concatenate([size, np.zeros(outputs)]), steps
    )
    if max(np.max(error), np.max(kink)) > SLOPE_TOLERANCE:
        reason = (
            "differ"
            if np.max(kink) > SLOPE_TOLERANCE
            else "depend on the size of the small deviation"
        )
        raise FvsolveError(
            f"{name} = {value:g} cannot be linearised: the slopes for a rise and a fall of this input "
            f"{reason}; set another value with --set, or choose another time with --at"
        )
    return slope / width[0], float(np.max(error))


# eigenvalues ------------------------------------------------------------------------------------------------------

# greatest number of states for which all eigenvalues are computed; above, some by ARPACK
MAX_DENSE = 1500
ARPACK_COUNT = 20  # eigenvalues that ARPACK computes at each place
# places on the spectral circle, from i to -1: the lower half plane mirrors the upper one
RIM_PLACES = 5
RESTARTS, TIME_LIMIT = 12, 10.0  # restarts of ARPACK at each place; time limit of all places [s]
POLES = (
    Column("real", "real [1/s]", ".6g"),
    Column(
        "imaginary",
        "imaginary [1/s]",
        lambda pole: f"±{pole['imaginary']:.6g}" if pole["pair"] else "-",
    ),
    Column("pair"),
    Column("frequency", "frequency [Hz]", ".6g"),
    Column("damping", words=".4f"),
    Column("time_constant", "time constant [s]", ".4g"),
)
# of the greatest modulus: smaller eigenvalues and real or imaginary parts are round-off
ZERO_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues `values` of a case [1/s], by rising modulus.

    complete : True if these are all eigenvalues; description : text on which eigenvalues these are
    """

    values: np.ndarray
    complete: bool
    description: str

    def poles(self) -> list[dict]:
        """Dict for each real pole s and each complex pair: parts of s, frequency, damping ratio and time constant.

        The frequency is |s| / 2 pi [Hz], the damping ratio -Re s / |s| (None for s = 0), and the time constant
        1 / |Re s| [s] (None for Re s = 0).
        """
        rows = []
        for s in self.values[self.values.imag >= 0.0]:
            size = abs(s)
            rows.append(
                {
                    "real": float(s.real),
                    "imaginary": float(s.imag),
                    "pair": bool(s.imag > 0.0),
                    "frequency": float(size / (2.0 * np.pi)),
                    "damping": float(0.0 - s.real / size) if size > 0.0 else None,
                    "time_constant": float(1.0 / abs(s.real)) if s.real != 0.0 else None,
                }
            )
        return rows


def poles_of(a: Any, form: EnergyForm) -> Spectrum:
    """Eigenvalues of the matrix A of a linearised case, computed in coordinates of the energy norm `form`.

    Motions that store no energy, such as free translation, have eigenvalues too, which are included.
    """
    form = form.suited_to(a)
    moving = find_eigenvalues(form.seen(a))
    if form.idle.shape[1] == 0:
        return moving
    idle = np.linalg.eigvals(form.idle_rows @ (a @ form.idle))
    values = sort_eigenvalues(np.concatenate([moving.values, idle]))
    some = f"{moving.description}; and {idle.size} of motions that store no energy"
    text = f"all {values.size}" if moving.complete else some
    return Spectrum(values, moving.complete, text)


def find_eigenvalues(e: Any) -> Spectrum:
    """Eigenvalues of a matrix e : float64[n, n] or sparse; all for up to 1500 states, else some, by ARPACK in 10 s.

    Raises FvsolveError if ARPACK finds no eigenvalue.
    """
    n = e.shape[0]
    if n <= MAX_DENSE:
        from scipy.linalg import eigvals

        values = eigvals(e if isinstance(e, np.ndarray) else e.toarray(), check_finite=False)
        return Spectrum(sort_eigenvalues(values), True, f"all {n}")
    rim_radius = spectral_radius(e)
    rim = [rim_radius * np.exp(1j * angle) for angle in np.linspace(0.5 * np.pi, np.pi, RIM_PLACES)]
    latest = time.monotonic() + TIME_LIMIT
    by_place = [eigenvalues_near(e, place, latest) for place in (1e-6 * rim_radius, *rim)]
    values = np.concatenate(by_place)
    if not values.size:
        raise FvsolveError(
            f"ARPACK found no eigenvalue of {n} states in time; all eigenvalues are computed for up to {MAX_DENSE} "
            "states: use fewer cells, --set links.NAME.cells=100"
        )
    digits = 9 - int(np.log10(np.abs(values).max()))
    distinct = sort_eigenvalues(
        np.unique(np.round(np.concatenate([values, values.conj()]), digits))
    )
    on_rim = sum(part.size > 0 for part in by_place[1:])
    zero = "eigenvalues nearest 0" if by_place[0].size else "none near 0 converged"
    on_circle = (
        f"nearest {on_rim} of {RIM_PLACES} places"
        if on_rim
        else f"none of {RIM_PLACES} places converged"
    )
    where = f"{zero}; on the circle |s| = {rim_radius:.4g} 1/s {on_circle}"
    return Spectrum(distinct, False, f"{distinct.size} of {n}: {where}; by ARPACK")


def spectral_radius(e: Any) -> float:
    """Estimate of the spectral radius of a matrix e [1/s]: mean growth of a vector in a power iteration."""
    v, sizes = np.random.default_rng(1).standard_normal(e.shape[0]), []
    for _ in range(200):
        v = e @ (v / np.linalg.norm(v))
        sizes.append(np.linalg.norm(v))
    return float(np.exp(np.mean(np.log(sizes[100:]))))


def eigenvalues_near(e: Any, place: complex, latest: float = np.inf) -> np.ndarray:
    """Eigenvalues of a sparse matrix that are nearest to the complex number `place`, by ARPACK : complex[k].

    The result is empty or incomplete if ARPACK does not converge, and empty at the time limit `latest`, a time of the
    monotonic clock [s].
    """
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, splu

    kind = complex if isinstance(place, complex) else float
    e, start = e.astype(kind), np.random.default_rng(1).standard_normal(e.shape[0]).astype(kind)
    if time.monotonic() > latest:
        return np.zeros(0)
    factors = splu((e - place * eye_array(e.shape[0])).tocsc())

    def solve(v: np.ndarray) -> np.ndarray:
        if time.monotonic() > latest:
            raise TimeoutError
        return factors.solve(v.astype(kind))

    inverse = LinearOperator(e.shape, matvec=solve, dtype=kind)
    try:
        return eigs(
            e,
            ARPACK_COUNT,
            sigma=place,
            OPinv=inverse,
            ncv=3 * ARPACK_COUNT,
            maxiter=RESTARTS,
            v0=start,
            return_eigenvectors=False,
        )
    except ArpackNoConvergence as error:
        return error.eigenvalues
    except TimeoutError:
        return np.zeros(0)


def sort_eigenvalues(values: np.ndarray) -> np.ndarray:
    """Sort eigenvalues by modulus; real and imaginary parts below 1e-10 of the greatest modulus are set to zero."""
    values = np.asarray(values, dtype=complex)
    floor = ZERO_TOLERANCE * np.max(np.abs(values), initial=0.0)
    real, imaginary = (
        np.where(np.abs(part) <= floor, 0.0, part) for part in (values.real, values.imag)
    )
    values = real + 1j * imaginary
    return values[np.lexsort((-values.imag, -values.real, np.round(np.abs(values), 12)))]
