"""Properties from CoolProp, with its errors as FluidError; tables of density along an isentrope; their disk cache.

CoolProp is imported on first use. The cache has one file per fluid, state, law and CoolProp version.
"""

import functools
import hashlib
import json
import math
import os
import re
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.compile.file_access import read as read_closed
from fvsolve.core.fluid.laws import LAWS
from fvsolve.core.fluid.oils import OILS
from fvsolve.errors import FluidError, did_you_mean
from fvsolve.jit import cache_folder, reading_folders

TABLE_PRESSURE = 1e8  # upper end of a table [Pa], or twice the reference pressure if that is higher
TARGET_ERROR = 1e-9  # relative density error at which refinement stops
MAX_ERROR = 1e-6  # relative density error above which a table is refused
INTERVALS = (32, 2048)  # least and greatest number of intervals


@dataclass(frozen=True, eq=False)
class FluidTable:
    """Density along the isentrope through the reference state, for cubic Hermite interpolation of ln rho.

    pressure        : float64[n]  absolute pressure [Pa], a uniform grid from the vapour pressure up
    log_density     : float64[n]  ln(rho / (1 kg/m3)) [-]
    compressibility : float64[n]  d ln rho / dp = 1 / (rho a^2) at constant entropy [1/Pa], a the speed of sound
    error           : greatest relative error of the density at the midpoints of the grid, against CoolProp [-]

    Outside the grid the compressibility keeps its end value, so that ln rho is extrapolated linearly. Below the vapour
    pressure CoolProp has no stable liquid.
    """

    pressure: np.ndarray
    log_density: np.ndarray
    compressibility: np.ndarray
    error: float

    def __post_init__(self) -> None:
        for name in ("pressure", "log_density", "compressibility"):
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FluidTable):
            return NotImplemented
        return all(
            np.array_equal(a, b)
            for a, b in zip(vars(self).values(), vars(other).values(), strict=True)
        )

    def __hash__(self) -> int:
        return hash((self.error, self.pressure.size))

    def numbers(self, density: float, pressure: float) -> list[float]:
        """Values and slopes at the grid for kernels, in one list: ln(rho / density), its slope, enthalpy, its slope.

        Each has one number per grid pressure. Slopes are derivatives by pressure [1/Pa], [J/kg/Pa].
        The enthalpy [J/kg] is the integral of dp / rho from `pressure`.
        density : density [kg/m3] at the reference pressure `pressure` [Pa]
        """
        p, k = self.pressure, self.compressibility
        step = (p[-1] - p[0]) / (len(p) - 1)
        log_density = self.log_density - hermite_at(p, self.log_density, k, pressure)
        nodes, weights = np.polynomial.legendre.leggauss(6)
        h = np.zeros(len(p))
        for x, w in zip(nodes, weights, strict=True):
            at = p[:-1] + 0.5 * (1.0 + x) * step
            h[1:] += 0.5 * w * step / (density * np.exp(hermite_at(p, log_density, k, at)))
        h = np.cumsum(h)
        slope = 1.0 / (density * np.exp(log_density))
        h -= hermite_at(p, h, slope, pressure)
        return [*log_density, *k, *h, *slope]


def hermite_at(grid, values, slopes, at):
    """Cubic Hermite interpolant at the abscissas `at`, from values and slopes (derivatives) on a uniform grid."""
    step = grid[1] - grid[0]
    k = np.clip(
        ((at - grid[0]) / step).astype(int)
        if hasattr(at, "astype")
        else int((at - grid[0]) / step),
        0,
        len(grid) - 2,
    )
    s = (at - grid[k]) / step
    r = 1.0 - s
    rise = values[k + 1] - values[k]
    return (
        values[k] + s * s * (3 - 2 * s) * rise + s * r * step * (r * slopes[k] - s * slopes[k + 1])
    )


def isentrope(state: Any, name: str, vapor_pressure: float) -> FluidTable:
    """Table of the isentrope through the present state of CoolProp's `state`, from the vapour pressure [Pa] up.

    The number of intervals starts at INTERVALS[0]. It is doubled until the error at midpoints is at most
    `TARGET_ERROR`, or until it is INTERVALS[1].
    name : name of the fluid for messages
    Raises FluidError if the state is not liquid, or if the table is not accurate enough.
    """
    temperature = state.T()
    pressure = state.p()
    entropy = state.smass()
    if not 0.0 < vapor_pressure < pressure:
        text = f'"table" needs a liquid, and {name} is not liquid at this temperature and pressure'
        raise FluidError("law", f'{text}; use "linear" or "log"')
    span = (vapor_pressure, _reach(state, temperature, pressure))
    intervals, max_intervals = INTERVALS
    try:
        table = _tabulate(state, span, intervals, temperature, entropy)
        while table.error > TARGET_ERROR and intervals < max_intervals:
            intervals *= 2
            table = _tabulate(state, span, intervals, temperature, entropy)
    except ValueError as error:
        raise FluidError(
            "law",
            f'"table" cannot be computed for {name} at these `temperature` and `pressure` ({error}); use "log"',
        ) from None
    if table.error > MAX_ERROR or not _monotone(table):
        text = f'"table" of {name} has a relative error of {table.error:.1g}, near its critical point; use "log"'
        raise FluidError("law", text)
    return table


def _reach(state: Any, temperature: float, pressure: float) -> float:
    """Upper end of the table [Pa]: `TABLE_PRESSURE`, or twice `pressure` if that is higher, within CoolProp's limits.

    temperature [K], pressure [Pa] : those of the reference state. CoolProp's limits are its greatest pressure and the
    melting pressure.
    """
    from CoolProp import CoolProp

    limits = [max(TABLE_PRESSURE, 2.0 * pressure), state.pmax()]
    melting = value_or_none(lambda: state.melting_line(CoolProp.iP, CoolProp.iT, temperature))
    if melting is not None and melting > pressure:
        limits.append(melting)
    return min(limits)


def _tabulate(
    state: Any, span: tuple[float, float], intervals: int, temperature: float, entropy: float
) -> FluidTable:
    grid = np.linspace(*span, 2 * intervals + 1)
    log_density, compressibility = _march(state, grid, temperature, entropy)
    f, d = log_density[::2], compressibility[::2]
    middle = 0.5 * (f[:-1] + f[1:]) + (grid[2] - grid[0]) / 8.0 * (d[:-1] - d[1:])
    error = float(np.max(np.abs(np.expm1(middle - log_density[1::2]))))
    return FluidTable(np.linspace(*span, intervals + 1), f, d, error)


def _march(
    state: Any, grid: np.ndarray, temperature: float, entropy: float
) -> tuple[np.ndarray, np.ndarray]:
    """(ln rho, 1 / (rho a^2) [1/Pa]) on the isentrope of `entropy` at the pressures of `grid` [Pa] : two float64[n].

    At each pressure the temperature follows by Newton iteration from that of the previous pressure, with ds/dT = cp/T.
    temperature : start value for the first pressure [K]; rho : density [kg/m3]; a : speed of sound [m/s]
    """
    from CoolProp import CoolProp

    log_density, compressibility = np.empty_like(grid), np.empty_like(grid)
    for i, pressure in enumerate(grid):
        # Below the critical pressure the phase is imposed; CoolProp would refuse states next to boiling.
        subcritical = pressure < state.p_critical()
        state.specify_phase(CoolProp.iphase_liquid if subcritical else CoolProp.iphase_not_imposed)
        for _ in range(12):
            state.update(CoolProp.PT_INPUTS, pressure, temperature)
            step = (entropy - state.smass()) * temperature / state.cpmass()
            if abs(step) <= 1e-11 * temperature:
                break
            temperature += step
        log_density[i] = math.log(state.rhomass())
        compressibility[i] = 1.0 / (state.rhomass() * state.speed_sound() ** 2)
    return log_density, compressibility


def _monotone(table: FluidTable) -> bool:
    """True if all slopes are 0 to 3 times those of adjacent chords, so that the cubics rise (Fritsch, Carlson 1980)."""
    chord = np.diff(table.log_density) / np.diff(table.pressure)
    slopes = np.concatenate([table.compressibility[:-1] / chord, table.compressibility[1:] / chord])
    return bool(np.all(chord > 0.0) and np.all(slopes >= 0.0) and np.all(slopes <= 3.0))


def value_or_none(read: Callable[[], float]) -> float | None:
    """Value that `read`, a call of CoolProp, returns; None if CoolProp has no model for it, or if it is not finite."""
    try:
        value = read()
    except ValueError:
        return None
    return value if math.isfinite(value) else None


FORMAT = 1  # version of format and contents of the cache; increase it when either changes
OIL_WORDS = ("oil", "hydraulic oil", "mineral oil", "hydraulic fluid", "hlp", "hm", "iso vg", "vg")


def cached_properties(name: str, temperature: float, pressure: float, law: str) -> dict[str, Any]:
    """Fields of `Fluid` from CoolProp, read from a file if they are cached there; CoolProp is then not imported.

    Arguments as for `coolprop_properties`.
    """

    def compute() -> dict[str, Any]:
        source = f"CoolProp {coolprop_version()}"
        return coolprop_properties(name, temperature, pressure, law) | {"source": source}

    return _cached(name, [temperature, pressure, law], compute)


def cached_specific_heat(name: str, temperature: float, pressure: float) -> float:
    """Specific heat at constant pressure from CoolProp [J/kg/K], cached as by `cached_properties`.

    Raises FluidError if CoolProp has none.
    """

    def compute() -> dict[str, Any]:
        from CoolProp.CoolProp import PropsSI

        value = value_or_none(lambda: PropsSI("C", "T", temperature, "P", pressure, name))
        return {"specific_heat": value, "table": None}

    value = _cached(name, [temperature, pressure, "specific heat"], compute)["specific_heat"]
    if value is None:
        raise FluidError("specific_heat", f"CoolProp has no specific heat of {name}")
    return value


def _cached(name: str, about: list, compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Result of `compute`, read from a file if it is cached there; name, about : fluid, and further text of the key."""
    key = json.dumps([FORMAT, coolprop_version(), name, *about])
    stem = re.sub(r"[^A-Za-z0-9.-]+", "-", name)[:40]
    file = f"fluids/{stem}-{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"
    found = (_read(folder / file, key) for folder in reading_folders())
    properties = next((item for item in found if item is not None), None)
    if properties is None:
        properties = compute()
        _write(cache_folder() / file, key, properties)
    return properties


@functools.cache
def coolprop_version() -> str:
    """Version of CoolProp, without importing it."""
    from importlib.metadata import version

    return version("CoolProp")


def _read(path: Path, key: str) -> dict[str, Any] | None:
    """Properties in a cache file; None if it is missing, damaged, of another key, or open to other users.

    key : text of name, state, law and versions
    """
    try:
        digest, body = (read_closed(path) or b"").decode().split("\n", 1)
        if digest != hashlib.sha256(body.encode()).hexdigest():
            return None
        stored_key, properties = json.loads(body)
        properties["table"] = properties["table"] and FluidTable(**properties["table"])
        return properties if stored_key == key else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _write(path: Path, key: str, properties: dict[str, Any]) -> None:
    """Write properties to a cache file atomically; do nothing if the folder cannot be written. key : as for `_read`"""
    body = json.dumps(
        [key, properties],
        default=lambda item: item.tolist() if hasattr(item, "tolist") else asdict(item),
    )
    text = hashlib.sha256(body.encode()).hexdigest() + "\n" + body
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(part, 0o644)  # users of a shared folder read it
        os.replace(part, path)
    except OSError:
        return


def coolprop_properties(name: str, temperature: float, pressure: float, law: str) -> dict[str, Any]:
    """Fields of `Fluid` from CoolProp, as a dict; temperature [K], pressure [Pa], law : name of the density law.

    density, bulk_modulus and viscosity are None if the fluid boils at this state; bulk_modulus is None for a fluid
    "INCOMP::...", and viscosity where CoolProp has no data.
    Raises FluidError for unknown names and for states outside CoolProp's range.
    """
    backend, _, rest = name.rpartition("::")
    if backend not in ("", "HEOS", "INCOMP"):
        raise FluidError(
            "name",
            f'"{name}" has an unknown prefix; expected a CoolProp fluid without a prefix, or "INCOMP::..."',
        )
    if backend == "INCOMP":
        return _incompressible_properties(name, temperature, pressure)
    return _pure_properties(rest, temperature, pressure, law)


def _pure_properties(name: str, temperature: float, pressure: float, law: str) -> dict[str, Any]:
    from CoolProp import CoolProp

    state = _pure_state(name)
    _check_range(state, name, temperature, pressure)
    vapor_pressure = _vapor_pressure(state, temperature)
    values = dict(
        density=None, bulk_modulus=None, viscosity=None, vapor_pressure=vapor_pressure, table=None
    )
    if pressure <= vapor_pressure:
        return values
    try:
        state.update(CoolProp.PT_INPUTS, pressure, temperature)
    except ValueError as error:
        text = f"{name} is two-phase at {celsius(temperature)} and {pressure:g} Pa, or CoolProp has no data ({error})"
        raise FluidError("pressure", f"{text}; try another temperature or pressure") from None
    values |= dict(density=state.rhomass(), bulk_modulus=state.rhomass() * state.speed_sound() ** 2)
    values["viscosity"] = value_or_none(state.viscosity)
    if LAWS[law].tabulated:
        values["table"] = isentrope(state, name, vapor_pressure)
    return values


def _pure_state(name: str) -> Any:
    """CoolProp state of a pure (or pseudo-pure) fluid; raises FluidError for mixtures and unknown names."""
    from CoolProp import AbstractState

    if "&" in name or "[" in name or name.endswith(".mix"):
        text = f'"{name}" is a mixture; expected a pure fluid or an "INCOMP::..." solution'
        raise FluidError("name", text)
    try:
        return AbstractState("HEOS", name)
    except ValueError:
        raise FluidError("name", f'"{name}" is not a CoolProp fluid{_suggestion(name)}') from None


def _suggestion(name: str) -> str:
    from CoolProp import CoolProp

    pure = CoolProp.get_global_param_string("FluidsList").split(",")
    oils = _incompressible_names()
    if name.casefold().replace("-", " ").strip() in OIL_WORDS:
        return f'; oils are {", ".join(OILS)}, or give a "user" fluid'
    if name in oils:
        return f'; did you mean "INCOMP::{name}"?'
    if name.startswith("INCOMP::"):
        return did_you_mean(name, [f"INCOMP::{oil}" for oil in oils])
    aliases = ",".join(CoolProp.get_fluid_param_string(fluid, "aliases") for fluid in pure).split(
        ","
    )
    return did_you_mean(name, ["user", *OILS, *filter(None, aliases), *pure])


def _incompressible_names() -> list[str]:
    from CoolProp import CoolProp

    lists = ("incompressible_list_pure", "incompressible_list_solution")
    return [name for key in lists for name in CoolProp.get_global_param_string(key).split(",")]


def _check_range(state: Any, name: str, temperature: float, pressure: float) -> None:
    from CoolProp import CoolProp

    _check_temperature(name, temperature, state.Tmin(), state.Tmax())
    if pressure > state.pmax():
        raise FluidError(
            "pressure", f"{pressure:g} Pa is above the range of {name}, up to {state.pmax():g} Pa"
        )
    melting = value_or_none(lambda: state.melting_line(CoolProp.iT, CoolProp.iP, pressure))
    if melting is not None and temperature < melting:
        where = f"{celsius(temperature)} and {pressure:g} Pa"
        raise FluidError(
            "temperature", f"{name} is solid at {where}; it melts at {celsius(melting)}"
        )


def _check_temperature(name: str, temperature: float, least: float, greatest: float) -> None:
    if not least <= temperature <= greatest:
        span = f"{celsius(least)} to {celsius(greatest)}"
        raise FluidError(
            "temperature", f"{celsius(temperature)} is outside the range of {name}, {span}"
        )


def _vapor_pressure(state: Any, temperature: float) -> float:
    """Vapour pressure [Pa] at a temperature [K]; 0 at and above the critical temperature."""
    from CoolProp import CoolProp

    if temperature >= state.T_critical():
        return 0.0
    state.update(CoolProp.QT_INPUTS, 0.0, temperature)
    return state.p()


def _incompressible_properties(name: str, temperature: float, pressure: float) -> dict[str, Any]:
    """Fields of `Fluid` of a fluid "INCOMP::...", as a dict; temperature [K], pressure [Pa].

    bulk_modulus is None, because CoolProp has no compressibility of these fluids.
    Where CoolProp has no data, the viscosity is None and the vapour pressure is 0.
    """
    from CoolProp.CoolProp import PropsSI

    bare = re.sub(r"(\[[^]]*\]|-[0-9.]+%)$", "", name.removeprefix("INCOMP::"))
    if bare not in _incompressible_names():
        raise FluidError(
            "name", f'"{name}" is not a CoolProp fluid{_suggestion("INCOMP::" + bare)}'
        )
    _check_temperature(
        name, temperature, *(PropsSI(key, f"INCOMP::{bare}") for key in ("TMIN", "TMAX"))
    )
    try:
        density = PropsSI("D", "T", temperature, "P", pressure, name)
    except ValueError as error:
        reason = str(error).split(" : PropsSI")[0]
        key = "pressure" if "ressure" in reason else "temperature"
        if "composition" in reason or "fraction" in reason:
            key = "name"
        raise FluidError(key, f"{name}: {reason}") from None
    viscosity = value_or_none(lambda: PropsSI("V", "T", temperature, "P", pressure, name))
    vapor_pressure = value_or_none(lambda: PropsSI("P", "T", temperature, "Q", 0, name))
    values = dict(
        density=density, bulk_modulus=None, vapor_pressure=vapor_pressure or 0.0, table=None
    )
    # CoolProp returns exactly 1 Pa s, exp(0), for fluids without viscosity data, such as LiBr.
    return values | dict(viscosity=None if viscosity == 1.0 else viscosity)


def celsius(temperature: float) -> str:
    """Text of a temperature in degC, such as "20 degC"; temperature : [K]"""
    return f"{temperature - 273.15:.6g} degC"
