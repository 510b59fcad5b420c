"""Strategies for random networks and their settings, for hypothesis."""

import random

from hypothesis import strategies as st
from reference.scenes import (
    WATER,
    chamber,
    inflow,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    tank,
    valve,
)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    """Strategy for numbers with four significant digits."""
    # the case file has no less
    return st.floats(low, high).map(lambda x: float(f"{x:.4g}") if abs(x) > 1e-30 else 0.0)


SEEDS = st.integers(0, 2**32 - 1)
SCHEMES = ["upwind", "muscl", "upwind5", "weno5", "fromm", "linear-upwind", "upwind3", "central"]
LIMITERS = ["minmod", "van-leer", "monotonized-central"]
BY_COURANT = ["ssp-rk3", "rk4", "ssp-rk10-4"]
IMPLICIT = [
    "implicit-euler",
    "trapezoid",
    "gauss-4",
    "radau-iia-3",
    "alexander-2",
    "lobatto-iiic-4",
]
BY_ERROR = [
    "rodas-4",
    "rodas-5p",
    "radau-iia-5",
    "esdirk-4",
    "tr-bdf2",
    "dormand-prince",
    "bogacki-shampine",
    "auto",
]
FLUIDS = {
    "linear": dict(WATER),
    "log": {**WATER, "law": "log"},
    "table": {"name": "Water", "temperature": 293.15, "law": "table"},
    "mixture": {**WATER, "law": "mixture", "air_fraction": 1e-3},
}
FRICTIONS = [
    {"model": "none"},
    {"model": "steady", "factor": 0.02},
    {"model": "quasi-steady", "roughness": 1e-4},
    {"model": "swamee-jain", "roughness": 1e-4},
    {"model": "hazen-williams", "coefficient": 110.0},
    {"model": "chezy-manning", "coefficient": 0.012},
]


@st.composite
def numerics(draw) -> dict:
    """Strategy for settings: any scheme, with explicit or implicit steps by Courant number, or with error control."""
    given = {"scheme": draw(st.sampled_from(SCHEMES))}
    if given["scheme"] == "muscl":
        given["limiter"] = draw(st.sampled_from(LIMITERS))
    kind = draw(st.sampled_from(["courant", "implicit", "rtol"]))
    if kind == "courant":
        return given | {
            "method": draw(st.sampled_from(BY_COURANT)),
            "courant": draw(between(0.3, 0.5)),
        }
    if kind == "implicit":
        return given | {
            "method": draw(st.sampled_from(IMPLICIT)),
            "courant": draw(between(0.5, 4.0)),
        }
    return given | {
        "method": draw(st.sampled_from(BY_ERROR)),
        "rtol": draw(st.sampled_from([1e-4, 1e-6])),
    }


def shuffled(names, seed: int) -> list[str]:
    """Names in a random order of the seed."""
    return random.Random(seed).sample(list(names), len(names))


def some_of(names: list[str], seed: int) -> set[str]:
    """At least one name, chosen by the seed."""
    order = shuffled(names, seed)
    return set(order[: 1 + seed % len(order)])


def pipes(start: str, end: str) -> st.SearchStrategy[dict]:
    """Strategy for pipes of one to eight cells with friction."""
    return st.builds(
        pipe,
        st.just(start),
        st.just(end),
        between(50.0, 300.0),
        between(0.1, 0.4),
        between(800.0, 1300.0),
        st.integers(1, 8),
        friction=st.sampled_from(FRICTIONS[1:]),
        minor_loss=st.sampled_from([0.0, 1.5]),
    )


def openings() -> st.SearchStrategy:
    """Strategy for openings of a valve: constant, with a ramp, or with a jump."""
    moved = st.builds(
        ramp, between(0.1, 0.6), between(0.02, 0.5), between(0.3, 1.0), st.sampled_from([0.0, 0.2])
    )
    return st.one_of(
        st.just(1.0),
        between(0.1, 1.0),
        moved,
        st.builds(step, between(0.1, 0.6), st.just(1.0), between(0.1, 0.9)),
    )


def nodes(hilly: bool) -> st.SearchStrategy[dict]:
    """Strategy for nodes inside a network."""
    high = {"elevation": between(-5.0, 8.0)} if hilly else {}
    drawn_off = st.one_of(
        st.none(),
        between(0.0, 5e-3),
        st.builds(step, between(0.1, 0.6), st.just(0.0), between(0.0, 5e-3)),
    )
    plain = st.builds(junction, drawn_off, **high)
    others = [
        st.builds(chamber, between(0.02, 0.5), **high),
        st.builds(tank, between(0.5, 3.0), between(15.0, 25.0), **high),
        st.builds(inflow, between(0.0, 3e-3), **high),
        st.builds(vessel, between(0.2, 1.0), between(0.05, 0.1), **high),
        st.builds(
            vessel,
            between(0.2, 1.0),
            between(0.05, 0.1),
            diameter=between(0.4, 0.8),
            slope=LEANS,
            **high,
        ),
    ]
    return st.one_of(plain, plain, plain, *others)


def vessel(volume: float, gas: float, **more) -> dict:
    """Table of an air vessel."""
    return {"type": "accumulator", "volume": volume, "gas_volume": gas, **more}


LEANS = st.sampled_from([0.0, 0.5])
MOVING = st.fixed_dictionaries({"time_constant": between(0.02, 0.5)})


@st.composite
def across(draw, start: str, end: str) -> dict:
    """Strategy for a link between two places of the network."""
    ends = {"from": start, "to": end}
    length, flow, head = (
        draw(between(10.0, 100.0)),
        draw(between(5e-3, 3e-2)),
        draw(between(5.0, 40.0)),
    )
    area, pressure = draw(between(1e-4, 3e-3)), draw(between(2e5, 6e5))
    regulator = draw(st.sampled_from(["pressure-reducing", "pressure-sustaining"]))
    discs = st.one_of(st.just({}), MOVING.map(lambda disc: disc | {"overpressure": 2e4}))
    return draw(
        st.sampled_from(
            [
                valve(start, end, draw(between(1e-4, 3e-3)), draw(openings())),
                draw(pipes(start, end)),
                {
                    "type": "rigid-column",
                    **ends,
                    "length": length,
                    "diameter": 0.1,
                    "friction": FRICTIONS[1],
                },
                {"type": "pump", **ends, "curve": {"flow": [flow], "head": [head]}},
                {"type": "check-valve", **ends, "area": area} | draw(discs),
                {
                    "type": "relief-valve",
                    **ends,
                    "area": area,
                    "set_pressure": pressure,
                    "overpressure": 2e4,
                }
                | draw(MOVING),
                {
                    "type": regulator,
                    **ends,
                    "area": area,
                    "set_pressure": pressure,
                    "time_constant": head / 10.0,
                },
            ]
        )
    )


@st.composite
def networks(draw, laws=tuple(FLUIDS), settings_of=None) -> dict:
    """Strategy for networks with a high lake, a low reservoir and one to four nodes on pipes between them.

    A valve joins a node to the reservoir; up to two links join random places, and a leak is optional.
    """
    hilly = draw(st.booleans())
    foot = {"elevation": 0.0} if hilly else {}
    places = {
        "high": lake(draw(between(30.0, 60.0)), **foot),
        "low": reservoir(draw(between(1.5e5, 3e5)), **foot),
    }
    links = {}
    for k in range(draw(st.integers(1, 4))):
        other = (
            "high" if k == 0 else draw(st.sampled_from([name for name in places if name != "low"]))
        )
        places[f"n{k}"] = (
            draw(nodes(hilly))
            if k
            else draw(
                st.builds(
                    junction, st.none(), **({"elevation": between(-5.0, 8.0)} if hilly else {})
                )
            )
        )
        links[f"p{k}"] = draw(pipes(other, f"n{k}"))
    inner = [name for name in places if name[0] == "n"]
    links["out"] = valve(
        draw(st.sampled_from(inner)), "low", draw(between(2e-4, 4e-3)), draw(openings())
    )
    for k in range(draw(st.integers(0, 2))):
        ends = draw(st.permutations(list(places)))[:2]
        links[f"x{k}"] = draw(across(*ends))
    if draw(st.booleans()):
        links["hole"] = {
            "type": "leak",
            "from": draw(st.sampled_from(inner)),
            "coefficient": draw(between(1e-6, 5e-6)),
        }
    for link in links.values():
        if hilly and link["type"] == "pipe" and draw(st.booleans()):
            link["profile"] = draw(
                profiles(
                    link["length"], *(places[link[end]]["elevation"] for end in ("from", "to"))
                )
            )
    fluid = FLUIDS[draw(st.sampled_from(laws))]
    made = scene(
        places,
        links,
        1.0,
        draw(settings_of or numerics()),
        probes(places, links),
        0.05,
        fluid=fluid,
    )
    made["output"]["fields"] = 0
    return made


@st.composite
def profiles(draw, length: float, low: float, high: float) -> dict:
    """Strategy for elevation profiles with one point off the straight line, less steep than the pipe.

    Chainages are exact in binary where they are added.
    """
    at, off, begin = (
        draw(between(0.3, 0.7)) * length,
        draw(between(-0.1, 0.1)) * length,
        draw(st.sampled_from([0.0, 512.0])),
    )
    return {
        "chainage": [begin, begin + at, begin + length],
        "elevation": [low, low + (high - low) * at / length + off, high],
    }


def probes(places: dict, links: dict) -> list[str]:
    """Probes of pressures, flows and levels of all parts."""
    found = [f"nodes.{name}.pressure" for name in places] + [f"links.{name}.flow" for name in links]
    found += [f"nodes.{name}.level" for name, one in places.items() if one["type"] == "tank"]
    for name, one in links.items():
        if one["type"] == "pipe":
            found += [f"links.{name}.pressure@0.37", f"links.{name}.flow@1"]
    return found
