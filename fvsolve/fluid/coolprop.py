"""Properties from CoolProp, with its errors as FluidError, and their disk cache.

CoolProp is imported on first use. The cache has one file per fluid, state, law and CoolProp version.
"""

import functools
import hashlib
import json
import os
import re
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fvsolve.errors import FluidError, did_you_mean
from fvsolve.fluid.isentrope_table import FluidTable, isentrope, value_or_none
from fvsolve.fluid.laws import LAWS
from fvsolve.fluid.oils import OILS
from fvsolve.jit import cache_folder

FORMAT = 1  # version of format and contents of the cache; increase it when either changes
OIL_WORDS = ("oil", "hydraulic oil", "mineral oil", "hydraulic fluid", "hlp", "hm", "iso vg", "vg")


def cached_properties(name: str, temperature: float, pressure: float, law: str) -> dict[str, Any]:
    """Fields of `Fluid` from CoolProp, read from a file if they are cached there; CoolProp is then not imported.

    Arguments as for `coolprop_properties`.
    """
    key = json.dumps([FORMAT, coolprop_version(), name, temperature, pressure, law])
    stem = re.sub(r"[^A-Za-z0-9.-]+", "-", name)[:40]
    path = cache_folder() / "fluids" / f"{stem}-{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"
    properties = _read(path, key)
    if properties is None:
        properties = coolprop_properties(name, temperature, pressure, law)
        properties["source"] = f"CoolProp {coolprop_version()}"
        _write(path, key, properties)
    return properties


@functools.cache
def coolprop_version() -> str:
    """Version of CoolProp, without importing it."""
    from importlib.metadata import version

    return version("CoolProp")


def _read(path: Path, key: str) -> dict[str, Any] | None:
    """Properties in a cache file; None if the file is missing or damaged, or was written for another key.

    key : text of name, state, law and versions
    """
    try:
        digest, body = path.read_text(encoding="utf-8").split("\n", 1)
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
        [key, properties], default=lambda item: item.tolist() if hasattr(item, "tolist") else asdict(item)
    )
    text = hashlib.sha256(body.encode()).hexdigest() + "\n" + body
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
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
            "name", f'"{name}" has an unknown prefix; expected a CoolProp fluid without a prefix, or "INCOMP::..."'
        )
    if backend == "INCOMP":
        return _incompressible_properties(name, temperature, pressure)
    return _pure_properties(rest, temperature, pressure, law)


def _pure_properties(name: str, temperature: float, pressure: float, law: str) -> dict[str, Any]:
    from CoolProp import CoolProp

    state = _pure_state(name)
    _check_range(state, name, temperature, pressure)
    vapor_pressure = _vapor_pressure(state, temperature)
    values = dict(density=None, bulk_modulus=None, viscosity=None, vapor_pressure=vapor_pressure, table=None)
    if pressure <= vapor_pressure:
        return values
    try:
        state.update(CoolProp.PT_INPUTS, pressure, temperature)
    except ValueError as error:
        raise FluidError(
            "pressure",
            f"{name} is two-phase at {celsius(temperature)} and {pressure:g} Pa, or CoolProp has no data ({error}); "
            "try another temperature or pressure",
        ) from None
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
    aliases = ",".join(CoolProp.get_fluid_param_string(fluid, "aliases") for fluid in pure).split(",")
    return did_you_mean(name, ["user", *OILS, *filter(None, aliases), *pure])


def _incompressible_names() -> list[str]:
    from CoolProp import CoolProp

    lists = ("incompressible_list_pure", "incompressible_list_solution")
    return [name for key in lists for name in CoolProp.get_global_param_string(key).split(",")]


def _check_range(state: Any, name: str, temperature: float, pressure: float) -> None:
    from CoolProp import CoolProp

    _check_temperature(name, temperature, state.Tmin(), state.Tmax())
    if pressure > state.pmax():
        raise FluidError("pressure", f"{pressure:g} Pa is above the range of {name}, up to {state.pmax():g} Pa")
    melting = value_or_none(lambda: state.melting_line(CoolProp.iT, CoolProp.iP, pressure))
    if melting is not None and temperature < melting:
        where = f"{celsius(temperature)} and {pressure:g} Pa"
        raise FluidError("temperature", f"{name} is solid at {where}; it melts at {celsius(melting)}")


def _check_temperature(name: str, temperature: float, least: float, greatest: float) -> None:
    if not least <= temperature <= greatest:
        span = f"{celsius(least)} to {celsius(greatest)}"
        raise FluidError("temperature", f"{celsius(temperature)} is outside the range of {name}, {span}")


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
        raise FluidError("name", f'"{name}" is not a CoolProp fluid{_suggestion("INCOMP::" + bare)}')
    _check_temperature(name, temperature, *(PropsSI(key, f"INCOMP::{bare}") for key in ("TMIN", "TMAX")))
    try:
        density = PropsSI("D", "T", temperature, "P", pressure, name)
    except ValueError as error:
        reason = str(error).split(" : PropsSI")[0]
        raise FluidError(_error_text(reason), f"{name}: {reason}") from None
    viscosity = value_or_none(lambda: PropsSI("V", "T", temperature, "P", pressure, name))
    vapor_pressure = value_or_none(lambda: PropsSI("P", "T", temperature, "Q", 0, name))
    values = dict(density=density, bulk_modulus=None, vapor_pressure=vapor_pressure or 0.0, table=None)
    # CoolProp returns exactly 1 Pa s, exp(0), for fluids without viscosity data, such as LiBr.
    return values | dict(viscosity=None if viscosity == 1.0 else viscosity)


def _error_text(reason: str) -> str:
    if "composition" in reason or "fraction" in reason:
        return "name"
    return "pressure" if "ressure" in reason else "temperature"


def celsius(temperature: float) -> str:
    """Text of a temperature in degC, such as "20 degC"; temperature : [K]"""
    return f"{temperature - 273.15:.6g} degC"
