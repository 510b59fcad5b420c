"""Electric energy of pumps and its cost: table `[energy]` of a case, and the results of a run."""

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from fvsolve.parts.pump.part import EFFICIENCY
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import PROFILE, Number, between, nonnegative

DAY, KWH = 86400.0, 3.6e6  # [s], [J]
# of a pump, see `law_energy`
STATES = ("running_time", "efficiency_time", "specific_energy_time", "energy", "cost")
# of a pump and all pumps after it in the file; only its extremes are recorded
TOTAL_POWER = "total_electric_power"


class EnergyUse(Table):
    """Table `[energy]`: the electric energy of every pump is added up, with its cost. Prices are in any currency."""

    price: Annotated[
        Schedule,
        Scheduled("number", about="price of electric energy per kWh, for pumps without `price`"),
    ] = Field(default_factory=lambda: constant(0.0))
    overall_efficiency: Annotated[
        float,
        Number(
            between(0, 1, open=True),
            "hydraulic power over electric power, for pumps without `overall_efficiency`",
            PROFILE,
        ),
    ] = EFFICIENCY
    demand_charge: Annotated[
        float,
        Number(
            nonnegative,
            "charge per kW of the greatest electric power of all pumps together, for the whole run",
            PROFILE,
        ),
    ] = 0.0


def pumps_of(links: dict[str, Any]) -> dict[str, Any]:
    """Pumps among the links of a case, by name."""
    return {name: link for name, link in links.items() if link.kind == "pump"}


def watched_powers(links: dict[str, Any]) -> dict[str, tuple[str, str]]:
    """Probes of which a run with `[energy]` records the extremes : text -> (pump, quantity)."""
    pumps = list(pumps_of(links))
    total = {f"links.{name}.{TOTAL_POWER}": (name, TOTAL_POWER) for name in pumps[:1]}
    return {f"links.{name}.electric_power": (name, "electric_power") for name in pumps} | total


def price_faults(links: dict[str, Any]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the faults (key path, message) of prices of pumps in a case without `[energy]`."""
    for name, pump in pumps_of(links).items():
        if pump.price is not None:
            yield (
                ("links", name, "price"),
                "has no effect without the table [energy]; add it, it may be empty",
            )


def energy_numbers(draft, name: str, part, rest: float) -> list[float]:
    """Numbers of a pump for `law_energy`; rest : flow regarded as zero [m3/s]"""
    energy, names = draft.case.energy, list(pumps_of(draft.case.conduits))
    given = part.overall_efficiency
    if given is None:
        given = EFFICIENCY if energy is None else energy.overall_efficiency
    price, place = part.price or (None if energy is None else energy.price), names.index(name) + 1
    following = draft.device_names.index(names[place]) if place < len(names) else -1
    points = (
        [0, given] if isinstance(given, float) else [len(given.flow), *given.flow, *given.value]
    )
    return [-1 if price is None else draft.schedules.add(price), rest, following, *points]


def energy_scales(draft, power: float, flow: float) -> list[float]:
    """Sizes of the states of a pump: their values after the run at a power [W] and a flow [m3/s]."""
    span = draft.case.numerics.end - draft.case.numerics.start
    energy = power * span
    return [span, span, energy / flow, energy, max(1e-3, energy / KWH)]


def energy_use(model, y, watched: dict[str, tuple[float, ...]], duration: float) -> dict[str, Any]:
    """Energy of the pumps of a run and its cost, as the energy report of EPANET; empty without `[energy]`.

    y : state at the end; watched : extremes by probe, see `watched_powers`; duration : time since the start [s]
    Entries of a pump, SI: `running_share` of the duration; means while it runs: `efficiency`, `specific_energy`
    [J/m3], `mean_power`; greatest `peak_power`; `energy`; `cost`, `cost_per_day`. A value is None for a pump that did
    not run. Entries of the total: energy, peak power of all pumps together, costs, `demand_charge` for it.
    """
    case = model.case
    if case.energy is None or not (names := list(pumps_of(case.links))):
        return {}
    place = {name: k for k, name in enumerate(model.state_names)}
    rows, days = {}, duration / DAY
    for name in names:
        time, e, per, energy, cost = (float(y[place[f"{name}.{state}"]]) for state in STATES)
        means = [value / time if time > 0.0 else None for value in (e, per, energy)]
        rows[name] = {
            "running_share": time / duration if duration > 0.0 else None,
            **dict(zip(("efficiency", "specific_energy", "mean_power"), means, strict=True)),
            "peak_power": watched[f"links.{name}.electric_power"][2],
            "energy": energy,
            "cost": cost,
            "cost_per_day": cost / days if days > 0.0 else None,
        }
    peak = watched[f"links.{names[0]}.{TOTAL_POWER}"][2]
    cost = sum(row["cost"] for row in rows.values())
    charge = case.energy.demand_charge * peak / 1000.0
    total = {
        "energy": sum(row["energy"] for row in rows.values()),
        "peak_power": peak,
        "cost": cost,
        "cost_per_day": cost / days if days > 0.0 else None,
        "demand_charge": charge,
    }
    return {"pumps": rows, "total": total}


HEADS = (
    "pump",
    "running",
    "efficiency",
    "per volume",
    "mean power",
    "peak power",
    "energy",
    "cost",
    "cost per day",
)
UNITS = ("", "%", "%", "kWh/m3", "kW", "kW", "kWh", "", "")


def table_rows(use: dict[str, Any]) -> list[list[Any]]:
    """Rows of a table with `HEADS` in `UNITS`, the last for all pumps together; use : result of `energy_use`"""
    factors = {
        "running_share": 100.0,
        "efficiency": 100.0,
        "specific_energy": 1.0 / KWH,
        "mean_power": 1e-3,
        "peak_power": 1e-3,
        "energy": 1.0 / KWH,
        "cost": 1.0,
        "cost_per_day": 1.0,
    }
    named = [*use["pumps"].items(), ("all", use["total"])]
    return [
        [
            name,
            *(
                None if row.get(key) is None else row[key] * factor
                for key, factor in factors.items()
            ),
        ]
        for name, row in named
    ]
