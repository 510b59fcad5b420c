"""Properties from CoolProp, with its errors as FluidError, and tables of density along an isentrope.

The file is imported only for properties that are not stored, see `property_cache`.
"""

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.core.fluid.fluid_table import MAX_ERROR, FluidTable, is_monotone, refined_table
from fvsolve.core.fluid.laws import law_named
from fvsolve.core.fluid.oils import OIL_WORDS, OILS
from fvsolve.errors import FluidError, did_you_mean
from fvsolve.units import celsius

TABLE_PRESSURE = 1e8  # upper end of a table [Pa], or twice the reference pressure if that is higher


def isentrope(state: Any, name: str, vapor_pressure: float) -> FluidTable:
    """Table of the isentrope through the present state of CoolProp's `state`, from the vapour pressure [Pa] up.

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
    try:
        table = refined_table(lambda grid: _march(state, grid, temperature, entropy), span)
    except ValueError as error:
        raise FluidError(
            "law",
            f'"table" cannot be computed for {name} at these `temperature` and `pressure` ({error}); use "log"',
        ) from None
    if table.error > MAX_ERROR or not is_monotone(table):
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


def value_or_none(read: Callable[[], float]) -> float | None:
    """Value that `read`, a call of CoolProp, returns; None if CoolProp has no model for it, or if it is not finite."""
    try:
        value = read()
    except ValueError:
        return None
    return value if math.isfinite(value) else None


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
    if law_named(law).from_coolprop:
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
