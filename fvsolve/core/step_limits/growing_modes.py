"""Greatest fixed step for modes other than plain waves: vessels, columns, devices, friction, features.

It is estimated at the start, from the eigenvalues s of the rates of all states outside cells, with the cells held
constant, and from the modes of cells: friction, unsteady friction, wall creep, and those of features. In a
step h the method multiplies a deviation by |R(h s)|, with its stability function R, and the exact solution by
|exp(h s)|; the quotient is the growth by the method. Slopes are differences over a hundredth of the forcing range: the
slope of a valve at zero pressure drop is infinite, and smaller oscillations about it are not relevant.

Friction couples the two waves of a pipe. With the slope g [1/s] of the friction force over the mass flow, the rate q of
cells that a wave crosses [1/s], and the symbol z of the scheme, the eigenvalues are
s = q Re z - g / 2 +- sqrt(g^2 / 4 - (q Im z)^2).

A given Courant number limits modes that decay; in waves the scheme damps the growth. A body on a spring has no such
damping: at an angular frequency w [rad/s] and a step h [s] its oscillation grows by |R(i w h)| in every step, however
short, with the stability function R; for ssp-rk2 by sqrt(1 + (w h)^4 / 4). The growth is estimated at the start.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from fvsolve.core.assembly.pipe_terms import elements
from fvsolve.core.kernels.steady_friction import drag_slope
from fvsolve.core.model.compiled_case import once_per_model
from fvsolve.core.schemes import SCHEMES
from fvsolve.core.step_limits.greatest_step import (
    excess_growth,
    growth_in_run,
    modes_limit,
    multiples,
)
from fvsolve.core.step_limits.symbol import symbol
from fvsolve.core.steppers.analysis.stability_function import stability_function
from fvsolve.core.steppers.analysis.stability_properties import imaginary_interval
from fvsolve.core.steppers.tableau import Method, method_named
from fvsolve.errors import Notice

OTHER_STATES = 1e3  # further factor for states driven by more than waves: contents, amounts
# scheduled keys of nodes
FORCING_KEYS = {"pressure": "pressure", "head": "head", "demand": "flow", "flow": "flow"}


@once_per_model
def forcing_sizes(model) -> np.ndarray:
    """Largest size that schedules and initial values can give to each state : float64[n].

    It is computed for cells of pipes and meshes; for delay lines and other states it is 1000 times their scale or more.
    """
    largest, linear = OTHER_STATES * model.scale, model.case.properties
    pressure, flow = pressure_and_flow_range(model)
    pipes = model.tables.pipes
    flow = max([flow, *np.abs(pipes["flow"])])
    if len(pipes):
        pressure = max(pressure, flow / float(pipes["admittance"].min()))
    for mesh, row in zip(model.pipes, pipes, strict=True):
        if row["cells"] == 0:  # mass in a pipe without cells, less that of the profile
            waves = pressure * float(row["admittance"]) * mesh.length / float(row["speed"])
            largest[row["y"]] = OTHER_STATES * max(largest[row["y"]], waves)
            continue
        own = slice(row["y"], row["y"] + 2 * mesh.cells)
        largest[own] = np.maximum(max(pressure * float(row["admittance"]), flow), model.scale[own])
    for part in model.meshed:
        states, scales = part.states_of(largest), part.states_of(model.scale)
        ratio = 1.0 + pressure / (linear.density * model.case.gravity)
        for own, scale, start in zip(states, scales, part.states_of(model.start), strict=True):
            own[:] = np.maximum(ratio * scale, np.ptp(start))
    return largest


@once_per_model
def pressure_and_flow_range(model) -> tuple[float, float]:
    """Greatest range of pressures [Pa] and greatest magnitude of mass flow [kg/s] that the forcing of nodes gives.

    The range is that of the initial pressures of all nodes, or of a single schedule if it is greater. The flow is that
    of schedules only.
    """
    rho, gravity = model.case.properties.density, model.case.gravity
    at_start = model.tables.nodes["pressure"]
    pressures, flow = [float(np.ptp(at_start)) if len(at_start) else 0.0], 0.0
    for node in model.case.nodes.values():
        for key, kind in FORCING_KEYS.items():
            values = getattr(vars(node).get(key), "value", None)
            if not isinstance(values, np.ndarray) or not values.size:
                continue
            if kind == "flow":
                flow = max(flow, rho * float(np.abs(values).max()))
            else:
                pressures.append(float(np.ptp(values)) * (rho * gravity if kind == "head" else 1.0))
    return max(pressures), flow


@once_per_model
def states_outside_cells(model) -> np.ndarray:
    """Numbers of the states outside cells and delay lines: storing nodes, columns, devices, features : int64[k]."""
    pipes = model.tables.pipes
    lines = set(pipes["y"][pipes["cells"] == 0].tolist())
    names = model.state_names.single()
    return np.array([i for i, name in names if "[" not in name and i not in lines], dtype=np.int64)


@once_per_model
def state_ranges(model, share: float = 1.0) -> np.ndarray:
    """Range of each state : float64[n].

    For a storing node it is the change of mass over the range of pressures of `pressure_and_flow_range`, for other
    states `share` times their scale.
    """
    ranges, spread = share * model.scale, pressure_and_flow_range(model)[0]
    for row in model.tables.nodes:
        if row["y"] >= 0 and row["stiffness"] > 0.0 and spread > 0.0:
            ranges[row["y"]] = spread / row["stiffness"]
    return ranges


SHARE = 0.01  # fraction of the forcing range over which slopes are taken
MOST = 300  # number of states above which no prediction is made
# growth factor in a run below which no notice is given: some growth is unavoidable
LEAST_GROWTH = 10.0
LEAST = 1e-15  # least step in the search for the limit, relative to the given step
HALVINGS = 40  # number of bisections in this search
# |h s| up to which a mode is resolved by the steps, and grows as predicted at the start
RESOLVED = 1.0
PHASES = np.linspace(0.0, np.pi, 65)
NOTICE_GROWTH = 1.01  # growth of an undamped oscillation in a run above which a notice is given
# greatest damping rate of a mode that counts as undamped, relative to its frequency
GREATEST_DAMPING = 0.1

Modes = list[tuple[str, np.ndarray]]  # places and eigenvalues there [1/s]


class Mode(NamedTuple):
    """Fastest growing of several modes of a model, in a run with a given step; see `fastest_growing`.

    place : name of the part or state; growth : growth factor in the run, over the exact growth factor
    limit : step [s] up to which the growth is below the factor `enough` of `fastest_growing`
    outside_cells : True for states outside cells, whose growth may end because the state changes or a law bounds it
    resolved : True if the steps resolve the mode; frequency : frequency of its oscillation [Hz]
    """

    place: str
    growth: float
    limit: float
    outside_cells: bool
    resolved: bool
    frequency: float


def lumped_modes(model, method: str, step: float, count: float | None = None) -> list[Mode]:
    """Fastest growing mode of the states outside cells, and that of the cells, with steps of `step` [s], as a list.

    count : number of steps of the run; default: the duration of the run over the step
    Modes that grow less than 10 times in the run are left out. Under a given Courant number only modes of waves with
    friction are computed. Raises FvsolveError for a method without a stability function.
    """
    r, numerics = stability_function(method), model.case.numerics
    span, fixed = numerics.end - numerics.start, numerics.step is not None
    own = modes_outside_cells(model) if fixed else []
    cells = friction_modes(model)
    if fixed:  # a Courant number limits the other modes
        cells += memory_modes(model)
        for feature in model.features:
            cells += feature.modes(model)
    # breaks of schedules shorten steps, but each still is a step
    span = max(span, step * (count or 0.0))
    candidates = [fastest_growing(r, modes, step, span, modes is own) for modes in (own, cells)]
    return [mode for mode in candidates if mode is not None]


def fastest_growing(
    r, modes: Modes, step: float, span: float, own: bool, enough: float = LEAST_GROWTH
) -> Mode | None:
    """Mode with the greatest growth, if it grows by the factor `enough` in a run of `span` [s]; otherwise None.

    r : stability function of the method; modes : pairs of a name and eigenvalues [1/s]; step : time step [s]
    own : True if the modes are of states outside cells
    """
    if not modes:
        return None
    s = np.concatenate([values for _, values in modes])
    shorter = multiples(0.5 * step, 0.5, LEAST * step)
    limit = modes_limit(r, s, span, enough, [step], shorter, halvings=HALVINGS)
    if limit.step == math.inf:
        return None
    worst = int(np.argmax(excess_growth(r, s, step)))
    at = int(np.searchsorted(np.cumsum([values.size for _, values in modes]), worst, side="right"))
    frequency = abs(float(s[worst].imag)) / (2.0 * math.pi)
    grown = growth_in_run(r, s, step, span)
    resolved = bool(abs(step * s[worst]) <= RESOLVED)
    return Mode(modes[at][0], grown, limit.step or limit.fails, own, resolved, frequency)


def modes_outside_cells(model) -> Modes:
    """Eigenvalues [1/s] of the states outside cells at the start, each with the name of the state that moves most.

    The list is empty for more than 300 such states, and for slopes that are not finite.
    """
    states = states_outside_cells(model)
    if not 0 < states.size <= MOST:
        return []
    t = float(model.case.numerics.start)
    y = model.start
    width = SHARE * state_ranges(model)
    out, j = model.new_out(), np.zeros((states.size, states.size))

    def rates(moved: np.ndarray) -> np.ndarray:
        result = np.zeros(model.y_size)
        model.functions.rhs(t, moved, result, out, run_data.handle)
        return result[states]

    with model.run_data() as run_data:
        run_data.evaluate(t, y, np.inf)  # sets the device states there
        for k, i in enumerate(states):
            high, low = y.copy(), y.copy()
            high[i], low[i] = y[i] + width[i], y[i] - width[i]
            j[:, k] = (rates(high) - rates(low)) / (2.0 * SHARE)
    j /= state_ranges(model)[states][:, None]
    if not np.all(np.isfinite(j)):
        return []
    values, vectors = np.linalg.eig(j)
    most = states[np.argmax(np.abs(vectors), axis=0)]
    return [(model.state_names[i], values[k : k + 1]) for k, i in enumerate(most)]


# cells ----------


def friction_modes(model) -> Modes:
    """Modes of waves in pipes with friction, at the initial flow: pairs of pipe name and eigenvalues [1/s]."""
    scheme, modes = model.case.numerics.scheme, []
    weights = SCHEMES[scheme].smooth.weights
    from_arriving = model.tables.settings[0]["from_arriving"] and model.case.law.linear
    symbols = {n: pipe_symbol(tuple(weights), n) for n in {mesh.cells for mesh in model.pipes}}
    for mesh, row, q in zip(model.pipes, model.tables.pipes, model.wave_rates, strict=True):
        g = friction_slope(row)
        if g > 0.0 and row["cells"] > 0 and from_arriving:
            # Friction of the waves that enter a cell follows their transport, which amplifies nothing up to its own
            # limit; it multiplies the flow by 1 - h g.
            modes.append((mesh.name, np.array([-g + 0j])))
        elif g > 0.0 and row["cells"] > 0:
            z = symbols[mesh.cells]  # waves between two ends are longer than two cells
            root = np.sqrt(0.25 * g * g - (q * z.imag) ** 2 + 0j)
            modes.append(
                (
                    mesh.name,
                    np.concatenate([q * z.real - 0.5 * g + root, q * z.real - 0.5 * g - root]),
                )
            )
    return modes


@functools.lru_cache(maxsize=256)
def pipe_symbol(weights: tuple, n: int) -> np.ndarray:
    """Symbol of a scheme for 65 waves between the ends of a pipe of n cells : complex128[65].

    It is the complex growth rate of a wave, divided by the rate of cells that a wave crosses.
    weights : weights of cells in the value at a face
    """
    values = symbol(weights, PHASES * (1.0 - 0.5 / n))
    values.flags.writeable = False
    return values


def memory_modes(model) -> Modes:
    """Modes of unsteady friction and wall creep: for each pipe an estimate of the eigenvalue of the fastest decay.

    It is minus the sum of the rate of the fastest relaxation term and the gains of all terms; for unsteady friction the
    sum includes the slope of the steady friction.
    Returns pairs of the name and the eigenvalue [1/s].
    """
    modes, floats = [], model.tables.floats
    for mesh, row in zip(model.pipes, model.tables.pipes, strict=True):
        if row["terms"] > 0:
            gain, rate = floats[row["term"] : row["term"] + 2 * row["terms"]].reshape(-1, 2).T
            modes.append(
                (f"{mesh.name}.memory", np.array([-rate.max() - gain.sum() - friction_slope(row)]))
            )
        if row["elements"] > 0:
            gain, rate = elements(floats, row).T
            modes.append((f"{mesh.name}.creep", np.array([-rate.max() - gain.sum()])))
    return modes


def friction_slope(row) -> float:
    """Derivative of the friction force per length with respect to mass flow [1/s], at the initial flow.

    row : row of the pipe in the table of pipes
    """
    return float(
        drag_slope(
            *(row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds", "flow"))
        )
    )


# undamped oscillations ----------


def undamped_notices(model, method: str, step: float, span: float) -> list[Notice]:
    """Notice for the oscillation that grows most in a run of `span` [s] with a first step of `step` [s], as a list.

    The list is empty if no oscillation grows by more than 1 %, without a given Courant number, and for a method whose
    stability region contains a part of the imaginary axis near 0.
    """
    numerics = model.case.numerics
    if numerics.courant is None or covers_axis(method_named(method)):
        return []
    modes = [
        (place, s)
        for place, s in modes_outside_cells(model)
        if np.all(np.abs(s.real) < GREATEST_DAMPING * np.abs(s.imag))
    ]
    mode = fastest_growing(stability_function(method), modes, step, span, True, NOTICE_GROWTH)
    if mode is None:
        return []
    grows = (
        f"by {100.0 * (mode.growth - 1.0):.3g} %"
        if mode.growth < 2.0
        else f"{mode.growth:.3g} times"
    )
    size = f"{numerics.courant * mode.limit / step:.3g}"
    text = (
        f"{mode.place}: an oscillation at {mode.frequency:.4g} Hz with little damping grows {grows} in the run, at "
        f"{math.log(mode.growth) / span:.3g} 1/s, with {method} and steps of {model.case.step_amount(step, 4)} "
        "(estimated at the start), because the method is unstable on the imaginary axis; give "
        f'numerics.method = "ssp-rk3", or numerics.courant = {size}, with which the growth is 1 %'
    )
    return [
        Notice(
            "swing",
            mode.place,
            text,
            "courant",
            mode.growth,
            NOTICE_GROWTH,
            mode.growth < LEAST_GROWTH,
        )
    ]


@functools.lru_cache(maxsize=256)
def covers_axis(method: Method) -> bool:
    """True if the stability region of a method contains a part of the imaginary axis near 0."""
    return imaginary_interval(stability_function(method)) > 0.0
