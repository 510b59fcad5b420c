"""Operating points for linearisation: a state of a case with schedules held at their values."""

from dataclasses import dataclass, replace

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.ghost_cells import difference_rows
from fvsolve.kernels.schedule_pieces import POLYNOMIAL, piece_at, piece_slopes, value_with_limit
from fvsolve.schemes import LIMITED, SCHEMES
from fvsolve.step_limits.symbol import symbol
from fvsolve.studies.outcome import outcome, study_model
from fvsolve.studies.resolution import as_cells, delay_lines

DELAY_ERROR = 0.01  # relative error of a wave in cells that replace a delay line, for the frequency in the note


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """State of a case about which it is linearised, and model with schedules held at their values.

    t : time at which schedules are held [s]; y : float64[n]  state, as deviations from the initial steady state
    when : description of this time, with the side of a kink or jump of a schedule
    armed : flags of events at this time, see `model.run_data.RunData`; 0 at the start
    """

    model: object
    t: float
    y: np.ndarray
    when: str
    armed: np.ndarray | float = 0.0

    @property
    def rate(self) -> np.ndarray:
        """Rate of change dy/dt of the state : float64[n]; zero at a steady state."""
        return self.model.rhs(self.t, self.y)


def operating_point(case, set=None, at: float | None = None, before: bool = False, probes=()) -> OperatingPoint:
    """Operating point of a case at its start, or at the time `at` [s], to which the case is run.

    set : changed keys of the case; before : True to hold schedules at the values just before a kink or jump at this
    time, otherwise just after it
    probes : names of probes that are added before the probes of the case
    Delay lines are replaced by cells. If the case gives no scheme and the default scheme is limited, it is replaced by
    the linear scheme that it equals in smooth solutions, or by `upwind` in a case with basins. Raises CaseError for a
    case or probe that cannot be read, and FvsolveError for a case without states, for a time `at` before the start, and
    for a run that does not reach `at`.
    """
    from fvsolve.case import load

    case = load(case, dict(set or {}))
    delayed = delay_lines(case)
    if delayed:
        case = load(case, as_cells(delayed))
    if "scheme" not in case.raw["numerics"] and case.numerics.scheme in LIMITED:
        linear = "upwind" if case.meshes else SCHEMES[case.numerics.scheme].twin
        case = load(case, {"numerics.scheme": linear})
    names = list(dict.fromkeys([*probes, *(probe.text for probe in case.probes)]))
    end = case.numerics.end if at is None else max(case.numerics.end, float(at))
    model = study_model(case, {"output.probes": names, "numerics.end": end})
    if model.y_size == 0:
        raise FvsolveError(f"{case.name} has no state: every pressure in it is given; add a pipe, tank or chamber")
    t, y, armed = _state_at(model, at)
    sides = {time: jump for time, jump in model.breaks if time == t}
    side = "before" if before else "after"
    when = "the start" if at is None else f"t = {case.amount(t, 'time', 6)}"
    when += f", just {side} a {'jump' if sides[t] else 'kink'} of a schedule" if t in sides else ""
    when += frequency_limit_note(model, delayed) if delayed else ""
    return OperatingPoint(with_held_schedules(model, t, before), t, y, when, armed)


def frequency_limit_note(model, lines: list[str]) -> str:
    """Note with the frequency up to which cells in place of the delay lines `lines` are accurate.

    Up to this frequency, the error of a wave at the end of a line, relative to an exact delay, is at most 0.01.
    """
    theta = np.linspace(0.0, np.pi, 20001)[1:]
    error = np.abs(symbol(SCHEMES[model.case.numerics.scheme].weights, theta) + 1j * theta)
    rates = []
    for pipe, row in zip(model.pipes, model.tables.pipes, strict=True):
        if pipe.name in lines:
            accurate = theta[pipe.cells * error <= DELAY_ERROR]
            rates.append((accurate.max() if accurate.size else 0.0) * row["speed"] / row["dx"] / (2.0 * np.pi))
    return f", delay lines as cells (error of waves at most {DELAY_ERROR:g} up to {min(rates):.3g} Hz)"


def _state_at(model, at: float | None) -> tuple[float, np.ndarray, np.ndarray | float]:
    """Time [s], state and event flags of a run at the time `at` [s]; at the start if `at` is None."""
    start = model.case.numerics.start
    if at is None or at == start:
        return start, model.start.copy(), 0.0
    if not start < at < np.inf:
        raise FvsolveError(f"at = {at:g} s is not a finite time after the start of the case, {start:g} s")
    numerics = model.case.numerics.model_copy(update={"end": float(at)})
    run = outcome(replace(model, case=replace(model.case, numerics=numerics)))
    if not run.ok:
        raise FvsolveError(f"the run to t = {at:g} s, where the case is to be linearised, failed: {run.reason}")
    return float(at), run.y, run.run_data.armed


def with_held_schedules(model, t: float, before: bool = False):
    """Model with all schedules and all periodic velocities of basins held at their values at t [s].

    before : True for the values just before a kink or jump at t, otherwise just after it
    Schedules that drive joints and walls continue with their rate of change at this time. Kinks and jumps are removed.
    In a model without a limited scheme, `without_slope_limits` is applied too.
    """
    tables = model.tables
    schedules, limit = tables.schedules.copy(), t if before else np.inf
    values = [value_with_limit(tables.schedules, tables.pieces, k, t, limit) for k in range(len(schedules))]
    for k in range(len(schedules)):
        schedules[k] = (k, 1)
    rows = [[-np.inf, POLYNOMIAL, t, value, 0.0, 0.0, 0.0] for value in values]
    for k in {int(row["schedule"]) for table in (tables.bodies, tables.walls) for row in table} - {-1}:
        record = tables.schedules[k]
        piece = piece_at(tables.pieces, record["first"], record["pieces"], t, limit)
        rows[k][4] = piece_slopes(tables.pieces, piece, t)[0]
    tables = tables._replace(schedules=schedules, pieces=np.array(rows).reshape(-1, 7))
    tables = with_held_velocities(model, tables, t)
    if not has_limiter(model):
        tables = without_slope_limits(tables)
    return replace(model, tables=tables, breaks=[])


def without_slope_limits(tables: rec.Tables) -> rec.Tables:
    """Tables of a model without slopes of scalars in pipe cells and without bounds of scalars.

    Limited slopes and bounds are kinks of the right-hand side, which has no derivative there.
    """
    settings, scalars = tables.settings.copy(), tables.scalars.copy()
    settings["limiter"] = rec.FLAT
    scalars["least"], scalars["greatest"] = -np.inf, np.inf
    return tables._replace(settings=settings, scalars=scalars)


def with_held_velocities(model, tables: rec.Tables, t: float) -> rec.Tables:
    """Tables of a model in which given velocities of basins that reverse periodically are held at their values at t."""
    if not any(row["period"] > 0.0 for row in tables.basins):
        return tables
    tables = tables._replace(basins=tables.basins.copy(), plane=tables.plane.copy())
    for basin, row in zip(model.basins, tables.basins, strict=True):
        if row["period"] > 0.0:
            grid = basin.mesh.grid
            faces = grid.ny * (grid.nx + 1) + (grid.ny + 1) * grid.nx if basin.is_grid else basin.mesh.left.size
            factor = np.cos(np.pi * t / row["period"])
            tables.plane[row["flows"] : row["flows"] + faces] *= factor
            row["fastest"], row["period"] = abs(factor) * row["fastest"], 0.0
    return tables


def with_weights(at: OperatingPoint, weights: tuple[float, ...], degree: int) -> OperatingPoint:
    """Operating point with another linear scheme.

    weights : weights of the cells around a face in the value at the face; degree : degree of the polynomials at pipe
    ends
    The stencil must not be wider than that of the scheme of `at`, whose Jacobian pattern is reused.
    """
    tables = at.model.tables._replace(settings=at.model.tables.settings.copy())
    settings = tables.settings[0]
    settings["scheme"], settings["degree"] = rec.LINEAR, degree
    for k, weight in enumerate(weights):
        settings[f"w{k}"] = weight
    settings["inside"], settings["enter"], settings["leave"] = difference_rows(weights, degree)
    model = replace(at.model, tables=tables)
    model.__dict__["structure"] = at.model.structure
    return replace(at, model=model)


def has_limiter(model) -> bool:
    """True if a model uses a limited scheme, in pipes with cells or in basins, see `basin_has_limiter`."""
    scheme = model.case.numerics.scheme
    if any(basin_has_limiter(basin, scheme) for basin in model.basins):
        return True
    return model.cells > 0 and scheme in LIMITED


def basin_has_limiter(basin, scheme: str) -> bool:
    """True if a basin limits its slopes: with all schemes except `upwind`, and except `upwind5` on basin grids."""
    return scheme != "upwind" and not (scheme == "upwind5" and basin.is_grid)
