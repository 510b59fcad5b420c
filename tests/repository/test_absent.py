"""Parts that a case lacks cost no state, no table row and no compiled function."""

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from reference.bodies import bodies, pendulum
from reference.folders import CASES
from reference.scenes import WATER, chamber, junction, pipe, reservoir, scene, tank, valve

import fvsolve
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import PHASES
from fvsolve.core.model import RunData
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.jit import COMPILING

PIPES = {"pipes", "ghost_cells", "reconstruction", "fused_step"}
MASSES = {"mass_dynamics"}
BODIES = {"body_kinematics", "mass_matrix", "moving_frames", "bushings_and_pins"}
DEVICES = {"check_valve", "regulator", "pump", "accumulator"}
MEMORY = {"relaxation"}  # of unsteady friction
IMPLICIT = {
    "newton",
    "dirk",
    "irk",
    "ros",
    "structure",
    "linear_dense",
    "linear_banded",
    "linear_sparse",
}
CAVITIES = {"cavitating_pipes", "cavitating_nodes", "riemann"}
JOBS = (*PHASES, "observe", "record", "events")
SCALARS = {"scalar_transport"}
ALL = SCALARS | PIPES | MASSES | BODIES | DEVICES | MEMORY | CAVITIES | IMPLICIT


def compiled_with(*functions) -> set[str]:
    """Files of all functions that numba compiles for the given functions, directly or through calls."""
    waiting, seen = [getattr(one, "function", one) for one in functions], {}
    while waiting:
        one = getattr(waiting.pop(), "py_func", None) or waiting
        if not hasattr(one, "__code__") or one in seen:
            continue
        seen[one] = Path(one.__code__.co_filename).stem
        names = one.__code__.co_names
        named = [one.__globals__.get(name) for name in names]
        spaces = [space for space in named if isinstance(space, ModuleType)]
        named += [getattr(space, name, None) for space in spaces for name in names]
        waiting += [found for found in named if hasattr(found, "py_func")]
    return set(seen.values())


def files(model) -> set[str]:
    loop, own = RunLoop(model), model.functions.cast.functions(*JOBS)
    return compiled_with(*own, loop.stepper.attempt, loop.stepper.run_steps, *loop.stepper.algebra)


def tanks(**numerics) -> dict:
    nodes = {"high": tank(3.0, 4.0), "low": tank(1.5, 1.0)}
    return scene(nodes, {"hole": valve("high", "low", 0.003)}, 10.0, numerics, ["high.level"])


def line(**numerics) -> dict:
    nodes = {"lake": reservoir(1e6), "gate": junction(), "end": chamber(0.1)}
    links = {
        "main": pipe("lake", "gate", 100.0, 0.3, 1000.0, 20),
        "hole": valve("gate", "end", 0.01),
    }
    return scene(nodes, links, 1.0, numerics, ["gate.pressure"])


@pytest.fixture
def compiling():
    """Skip a test if JIT is off, because nothing is compiled then."""
    if not COMPILING:
        pytest.skip("JIT is off")


def test_two_tanks_are_two_states_and_no_more():
    model = fvsolve.build(fvsolve.load(tanks()))
    assert model.state_names == ["high.mass", "low.mass"]
    rows = {name: len(rows) for name in rec.RECORDS if len(rows := getattr(model.tables, name))}
    assert rows == {
        "settings": 1,
        "layout": 1,
        "nodes": 2,
        "valves": 1,
        "schedules": 1,
        "probes": 1,
    }
    assert (
        model.new_out().size == rec.OUT_HEAD + 4 * 2 + 3
    )  # pressure, supply, net flow, code of isolated nodes; three of the valve
    assert RunData(model).envelope.size == 0


def test_two_tanks_compile_nothing_of_pipes_bodies_and_implicit_steps(compiling):
    assert files(fvsolve.build(fvsolve.load(tanks()))) & ALL == set()


@pytest.mark.parametrize("law", ["log", "table"])
def test_other_laws_compile_no_more_for_two_tanks(law, compiling):
    case = tanks() | {"fluid": {"name": "Water", "law": law}}
    assert files(fvsolve.build(fvsolve.load(case))) & ALL == set()


def test_each_folder_is_compiled_where_it_is_used(compiling):
    assert files(fvsolve.build(fvsolve.load(line()))) & ALL == PIPES - {"fused_step"}
    found = files(fvsolve.build(fvsolve.load(tanks(method="implicit-euler", step=0.1))))
    assert found & ALL == {"newton", "dirk", "structure", "linear_dense"}
    dyed = line() | {"scalars": {"dye": {}}}
    assert files(fvsolve.build(fvsolve.load(dyed))) & ALL == PIPES - {"fused_step"} | SCALARS
    log = line() | {"fluid": {"name": "Water", "law": "log"}}
    assert files(fvsolve.build(fvsolve.load(log))) & ALL == PIPES - {"fused_step"}
    wet = {**WATER, "law": "mixture", "air_fraction": 1e-6, "cavitation": True}
    found = files(fvsolve.build(fvsolve.load(line(scheme="muscl") | {"fluid": wet})))
    assert found & ALL == CAVITIES | {"reconstruction"}
    cylinder = fvsolve.build(fvsolve.load(CASES / "closed-cylinder.toml"))  # law: log
    assert files(cylinder) & (PIPES | MASSES | BODIES) == MASSES
    arm = fvsolve.build(fvsolve.load(bodies({"arm": pendulum()}, 1.0)))
    assert files(arm) & BODIES == BODIES - {"bushings_and_pins"} and not files(arm) & PIPES


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_scene_without_pipes_has_the_same_rates_as_with_a_pipe(law):
    """The second case adds a pipe at rest, from a reservoir to a junction behind a shut valve."""
    alone = tanks() | {"fluid": {**tanks()["fluid"], "law": law}}
    nodes = alone["nodes"] | {"a": reservoir(101325.0 + 9806.65 * 4.0), "b": junction()}
    links = alone["links"] | {
        "line": pipe("a", "b", 10.0, 0.1, 1000.0, 8),
        "way": valve("b", "high", 0.0, opening=0.0) | {"area": 1e-6},
    }
    both = alone | {"nodes": nodes, "links": links, "numerics": {"end": 10.0, "scheme": "upwind5"}}
    one, other = (fvsolve.build(fvsolve.load(case)) for case in (alone, both))
    y = np.array([-30.0, 20.0])
    more = np.zeros(other.y_size)
    more[[other.state_names.index(name) for name in one.state_names]] = y
    found = dict(zip(other.state_names, other.rhs(0.0, more), strict=True))
    assert [found[name] for name in one.state_names] == pytest.approx(one.rhs(0.0, y), rel=1e-12)
    assert one.functions is not other.functions


POOLS = {
    "transport": {"velocity": {"expression": "swirl", "size": 2.0}, "scalars": {"dye": "1 + x"}},
    "free-surface": {"level": 1.0, "start": {"level": "1 + 0.1*x"}},
    "liquid": {"pressure": 1e6, "thickness": 1.0, "start": {"pressure": "1e6 + 1e5*x"}},
}
PATCHES = {"sea": {"side": "east", "boundary": "open"}, "gate": {"side": "west"}}


def pool(physics: str, links: bool, law: str = "linear", **numerics) -> dict:
    """Case of a basin, with a dye unless it is a liquid: alone, or with links that carry no flow into it."""
    shape = {"type": "basin", "physics": physics, "size": [2.0, 2.0], "cells": [8, 8]} | POOLS[
        physics
    ]
    shape |= {} if physics == "transport" else {"patches": PATCHES}
    nodes, joined = {"pool": shape}, {}
    if links:
        nodes |= {"a": reservoir(2e5), "b": reservoir(1e5)}
        joined = {"hole": valve("a", "b", 0.01)}
        # faces of water that a link joins have rates of their own, also while it is shut
        if physics == "liquid":
            joined |= {"shut": valve("pool.gate", "a", 0.01, opening=0.0)}
    case = scene(nodes, joined, 1e-3, numerics, fluid={**WATER, "law": law})
    return case if physics == "liquid" else case | {"scalars": {"dye": {}}}


@pytest.mark.parametrize(
    ("physics", "law"), [("transport", "linear"), ("free-surface", "linear"), ("liquid", "log")]
)
def test_an_isolated_basin_has_the_same_rates_as_with_a_link(physics, law):
    alone, both = (
        fvsolve.build(fvsolve.load(pool(physics, links, law))) for links in (False, True)
    )
    assert alone.functions.cast.alone and not both.functions.cast.alone
    y = fvsolve.initial_state(alone).y
    y += 1e-3 * np.cos(np.arange(y.size)) * np.abs(y).max()
    assert alone.state_names == both.state_names and np.abs(alone.rhs(0.0, y)).max() > 0.0
    assert np.array_equal(alone.rhs(0.0, y), both.rhs(0.0, y))


def test_a_basin_compiles_no_links_and_no_other_scheme(compiling):
    network, fifth = (
        {"restrictions", "linear_nodes", "basin_patches", "reconstruction"},
        {"fifth_order"},
    )
    muscl, weno5 = (
        files(fvsolve.build(fvsolve.load(pool("transport", False, scheme=s))))
        for s in ("muscl", "weno5")
    )
    assert muscl & (network | fifth) == {"reconstruction"}
    assert weno5 & (network | fifth) == fifth | {"reconstruction"}


def test_the_rates_are_called_no_more_often_than_the_steps_require():
    loop = RunLoop(fvsolve.build(fvsolve.load(tanks(method="rk4", step=0.1))))
    loop.begin(10.0, 1e308)
    loop.run(1e308)
    # the end of the last step; that of the first step, in which events are searched: their pace is not known yet
    assert loop.state["steps"] == 100 and loop.state["calls"] <= 4 * 100 + 2
