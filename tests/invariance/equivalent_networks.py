"""Equivalent descriptions of a network; each function returns a changed copy of a case."""

import copy
from typing import Any

from invariance.random_scenes import some_of

STRAIGHT = ("pipe", "valve", "orifice", "rigid-column")  # symmetric kinds


def changed(case: dict, table: str, **keys: Any) -> dict:
    """Case with changed keys in one of its tables."""
    return {**copy.deepcopy(case), table: {**copy.deepcopy(case[table]), **keys}}


def renamed(case: dict, call) -> dict:
    """Case with the name call(name) for every part."""
    said = copy.deepcopy(case)
    said["nodes"] = {call(name): node for name, node in said["nodes"].items()}
    said["links"] = {call(name): link for name, link in said["links"].items()}
    for link in said["links"].values():
        link |= {end: call(link[end]) for end in ("from", "to") if end in link}
    said["output"]["probes"] = [called(probe, call) for probe in said["output"]["probes"]]
    return said


def called(probe: str, call) -> str:
    group, part, what = probe.split(".", 2)
    return f"{group}.{call(part)}.{what}"


def reordered(case: dict, nodes: list[str], links: list[str]) -> dict:
    """Case with its nodes and links in the given order."""
    said = copy.deepcopy(case)
    return {
        **said,
        "nodes": {n: said["nodes"][n] for n in nodes},
        "links": {n: said["links"][n] for n in links},
    }


def swapped(case: dict, chosen: set[str]) -> dict:
    """Case with exchanged ends of the chosen links, and with the corresponding probes along them."""
    said = copy.deepcopy(case)
    for name in chosen:
        link = said["links"][name]
        link["from"], link["to"] = link["to"], link["from"]
        if "profile" in link:
            chainage, elevation = link["profile"]["chainage"], link["profile"]["elevation"]
            turned = [chainage[0] + chainage[-1] - one for one in reversed(chainage)]
            link["profile"] = {"chainage": turned, "elevation": elevation[::-1]}
    said["output"]["probes"] = [
        from_other_end(probe, case, chosen) for probe in said["output"]["probes"]
    ]
    return said


def drawn_from_other_end(case: dict, seed: int) -> tuple[dict, dict]:
    """Case with the ends of some links swapped, and arguments `name` and `change` of `alike` for it."""
    chosen = some_of(
        [name for name, link in case["links"].items() if link["type"] in STRAIGHT], seed
    )

    def sign(probe, values):
        return -values if ".flow" in probe and probe.split(".")[1] in chosen else values

    return swapped(case, chosen), {
        "name": lambda probe: from_other_end(probe, case, chosen),
        "change": sign,
    }


def from_other_end(probe: str, case: dict, chosen: set[str]) -> str:
    group, part, what = probe.split(".", 2)
    if group == "nodes" or part not in chosen or case["links"][part]["type"] != "pipe":
        return probe
    return f"{group}.{part}.{ ({'flow': 'flow@1', 'flow@1': 'flow@0', 'pressure@0.37': 'pressure@0.63'}[what]) }"


def raised(case: dict, height: float) -> dict:
    """Case with all elevations and heads raised by `height` [m]."""
    said = copy.deepcopy(case)
    for node in said["nodes"].values():
        node["elevation"] = node.get("elevation", 0.0) + height
        if "head" in node:
            node["head"] += height
    for link in said["links"].values():
        if "profile" in link:
            link["profile"]["elevation"] = [z + height for z in link["profile"]["elevation"]]
    return said


def straight(case: dict) -> dict:
    """Case without elevation profiles."""
    said = copy.deepcopy(case)
    for link in said["links"].values():
        link.pop("profile", None)
    return said


TEXT = {
    "length": (1e3, "mm"),
    "diameter": (100.0, "cm"),
    "wave_speed": (1e-3, "km/s"),
    "roughness": (1e6, "um"),
    "pressure": (1e-5, "bar"),
    "head": (100.0, "cm"),
    "elevation": (1e-3, "km"),
    "level": (1e3, "mm"),
    "volume": (1e3, "l"),
    "gas_volume": (1e6, "ml"),
    "demand": (1e3, "l/s"),
    "flow": (3600.0, "m3/h"),
}


def in_other_units(value: Any, key: str = "") -> Any:
    """Value with every quantity of `TEXT` as text with a unit, also the values of schedules."""
    if isinstance(value, dict) and key in TEXT and "value" in value:
        return {**value, "value": [in_other_units(one, key) for one in value["value"]]}
    if isinstance(value, dict):
        return {
            name: one if name in ("numerics", "output") else in_other_units(one, name)
            for name, one in value.items()
        }
    if key in TEXT and isinstance(value, float):
        factor, unit = TEXT[key]
        return f"{value * factor!r} {unit}"
    return value


def twice(case: dict, place: str) -> dict:
    """Case with two copies of the network and a shut valve between them."""
    said, other = copy.deepcopy(case), renamed(case, lambda name: f"{name}-too")
    shut = {"type": "valve", "from": place, "to": f"{place}-too", "area": 0.01, "opening": 0.0}
    said["nodes"] |= other["nodes"]
    said["links"] |= {**other["links"], "shut": shut}
    said["output"]["probes"] += other["output"]["probes"]
    return said


def later(case: dict, wait: float) -> dict:
    """Case with its start, end and schedules delayed by `wait` [s]."""
    said = shifted(copy.deepcopy(case), wait)
    said["numerics"] |= {"start": wait, "end": case["numerics"]["end"] + wait}
    return said


def shifted(value: Any, wait: float) -> Any:
    """Value with schedules delayed by `wait` [s]."""
    if isinstance(value, dict) and "value" in value:
        return {
            **value,
            **(
                {"time": [t + wait for t in value["time"]]}
                if "time" in value
                else {"start": value["start"] + wait}
            ),
        }
    return (
        {key: shifted(one, wait) for key, one in value.items()}
        if isinstance(value, dict)
        else value
    )


def denser(case: dict, times: float) -> dict:
    """Case with density, stiffness, viscosity and all pressures multiplied by `times`.

    Volumes, heads and times do not change.
    """
    said = copy.deepcopy(case)
    fluid = said["fluid"]
    fluid["pressure"] = 101325.0
    for key in ("density", "bulk_modulus", "viscosity", "vapor_pressure", "pressure"):
        fluid[key] *= times
    said["ambient_pressure"] *= times
    for node in said["nodes"].values():
        if "pressure" in node:
            node["pressure"] *= times
    for link in said["links"].values():
        for key in ("set_pressure", "overpressure", "cracking_pressure", "band"):
            if key in link:
                link[key] *= times
        if "coefficient" in link:  # coefficient of a leak per root of pressure
            link["coefficient"] /= times**0.5
    return said


def drawn_backwards(case: dict) -> dict:
    """Case with every junction with a demand replaced by an inflow of opposite sign."""
    said = copy.deepcopy(case)
    for name, node in said["nodes"].items():
        if node["type"] == "junction" and "demand" in node:
            brought = negative(node["demand"])
            said["nodes"][name] = {key: one for key, one in node.items() if key != "demand"} | {
                "type": "inflow",
                "flow": brought,
            }
    return said


def negative(value: Any) -> Any:
    return (
        {**value, "value": [-one for one in value["value"]]} if isinstance(value, dict) else -value
    )
