"""The Jacobian pattern contains all slopes of the rates; coloured differences find them and conserve mass."""

import functools

import numpy as np
import pytest
from reference import folders
from reference.jacobians import random_state, rates, stray
from reference.meshes import triangles, write
from reference.scenes import NO_FRICTION, SHARP, chamber, junction, lake, pipe, scene, tank, valve
from scipy.sparse import csc_array

import fvsolve
from fvsolve.core.kernels.calls import compile_as
from fvsolve.core.model import RunData
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.core.steppers import METHODS
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.run_handle import RHS_CALL, addresses, evaluate, open_run
from fvsolve.core.steppers.structure import KINDS, Structure, differences, multiply
from fvsolve.jit import njit

CASES = sorted(folders.CASES.glob("*.toml"))
SCHEMES = ["upwind", "linear-upwind", "fromm", "central", "upwind3", "upwind5", "muscl", "weno5"]
# [s]; valves of random networks are open, half shut, nearly shut, shut
TIMES = (0.0, 0.7, 2.3, 3.5)


def random_model(seed: int, scheme: str, law: str):
    return fvsolve.build(fvsolve.load(random_network(seed, scheme, law)))


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("law", ["linear", "log"])
def test_no_rate_depends_on_a_state_that_its_pattern_has_not(scheme, law):
    for seed in (0, 2):  # with friction and without
        model, rng = random_model(seed, scheme, law), np.random.default_rng(seed)
        assert max(stray(model, t, random_state(model, rng)) for t in TIMES) < 1e-7


@pytest.mark.parametrize("path", CASES, ids=lambda p: p.stem)
def test_shipped_cases_keep_to_their_pattern(path):
    model, rng = fvsolve.build(fvsolve.load(path)), np.random.default_rng(0)
    for t in (0.0, 0.5 * model.case.numerics.end):
        assert stray(model, t, random_state(model, rng)) < 1e-7


@pytest.mark.parametrize("scheme", ["upwind", "muscl", "upwind5", "weno5"])
def test_advected_scalars_stay_within_their_pattern_at_sides_and_corners_too(scheme):
    settings = {"nodes.sheet.cells": [14, 12], "numerics.scheme": scheme}
    model, rng = (
        fvsolve.build(fvsolve.load(CASES[0].parent / "swirl.toml", settings)),
        np.random.default_rng(0),
    )
    assert stray(model, 0.2, model.scale * rng.normal(size=model.y_size)) < 1e-7


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("physics", ["free-surface", "transport"])
def test_scalars_that_decay_spread_and_pass_the_boundary_keep_to_their_pattern(physics, scheme):
    patches = {
        "out": {"side": "east", "boundary": "open"},
        "in": {"side": "west", "span": [0.5, 1.5]},
    }
    pool = {"type": "basin", "size": [10, 2], "cells": [10, 8], "patches": patches}
    nodes, links = {"pool": pool}, {}
    if physics == "transport":
        pool |= {"physics": physics, "velocity": {"u": "where(abs(y - 1) < 0.5, 0.1*y, 0)"}}
    else:
        pool |= {"level": 0.6, "bed": "0.005*x", "manning": 0.01}
        nodes["works"], links["feed"] = (
            {"type": "inflow", "flow": 0.02},
            pipe("works", "pool.in", 5.0, 0.3, 50.0, 4),
        )
    dyes = {"dye": {"decay": 0.01, "diffusivity": 1e-3}, "heat": {"decay": 0.1}}
    implicit = {"scheme": scheme, "method": "radau-iia-5", "step": 0.1}
    given = scene(nodes, links, 1.0, implicit, scalars=dyes)
    if not links:
        del given["links"]
    model = fvsolve.build(fvsolve.load(given))
    y = model.start + model.scale * np.random.default_rng(0).normal(scale=0.05, size=model.y_size)
    assert stray(model, 0.2, y) < 1e-7 and stray(model, 0.2, model.start) < 1e-7


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("mesh", ["grid", "holes", "triangles"])
def test_an_isolated_basin_stays_within_its_pattern_with_and_without_scalars(
    tmp_path, mesh, scheme
):
    shape = {"size": [9.0, 6.0], "cells": [18, 12]}
    if mesh == "holes":
        shape["holes"] = [[3.0, 2.0, 4.5, 4.0]]
    if mesh == "triangles":
        write(tmp_path / "m.vtk", *triangles((9.0, 6.0), 1.0))
        shape = {"mesh": {"file": str(tmp_path / "m.vtk")}}
    pool = {"type": "basin", "level": 1.0, "bed": "0.2*sin(x)*cos(y)", "manning": 0.03} | shape
    for scalars in ({}, {"dye": {"diffusivity": 1e-3}, "heat": {}}):
        numerics = {"scheme": scheme, "method": "implicit-euler", "step": 0.1}
        made = scene({"pool": pool}, {}, 1.0, numerics) | ({"scalars": scalars} if scalars else {})
        model, rng = fvsolve.build(fvsolve.load(made)), np.random.default_rng(0)
        for size in (0.02, 0.2):
            assert (
                stray(
                    model,
                    0.2,
                    model.start + model.scale * rng.normal(scale=size, size=model.y_size),
                )
                < 1e-7
            )


def test_a_pipe_couples_no_more_than_its_scheme_reads():
    """With `upwind` a cell depends on itself, its upstream cell and, with friction or at ends, on its opposite wave.

    With `euler` friction depends on the waves that enter a cell: also on the upstream cell of the opposite wave.
    """
    counts = []
    for friction in (NO_FRICTION, {"model": "steady", "factor": 0.02}):
        links = {"p": pipe("a", "b", 90.0, 0.2, 1000.0, 9, friction=friction)}
        found = jacobian_pattern(
            fvsolve.build(
                fvsolve.load(scene({"a": lake(30.0), "b": lake(30.0)}, links, 1.0, SHARP))
            )
        )
        counts.append(found[:18].nnz)
        assert found[18:].toarray().sum() == 2  # supply of each lake: its edge cell
    # cell and upstream cell; opposite wave at ends, or everywhere with its upstream cell
    assert counts == [18 + 16 + 2, 18 + 16 + 18 + 16]


# differences ----------------------------------------------------------------------------------------------------


@functools.cache
def compiled_differences():
    """Function `differences`, compiled as in a stepper for a right-hand side given by its address."""

    @njit
    def differences_of(handle, run, t, y, f, supply, f_work):
        return differences(evaluate, handle, open_run(run), t, y, f, supply, f_work)

    return compile_as(differences_of, "hhtvvvv")


def slopes(model, t: float, y: np.ndarray, structure: Structure) -> np.ndarray:
    """Jacobian d(dydt, supply)/dy by compiled differences : float64[n + nodes, n]."""
    n, m, at = model.y_size, len(model.node_names), int(model.layout["supply"])
    slate = RunData(model)
    f, out = slate.evaluate(t, y, np.inf)
    supply = out[at : at + m].copy()
    stepper = Integrator(
        METHODS["implicit-euler"], n, structure.m, lambda: structure, model.scale.copy()
    )
    stepper.calls, stepper.out = addresses((model.functions.rhs,) * (RHS_CALL + 1)), model.new_out()
    stepper.control["ledger_offset"], stepper.jacobian[:] = at, np.nan
    calls = compiled_differences()(
        slate.handle, stepper.handle(False), t, y, f, supply, np.zeros(n)
    )
    jacobian = stepper.jacobian
    assert calls == structure.color_count
    x, product = np.random.default_rng(0).normal(size=n), np.zeros(n + m)
    multiply(structure.shape, jacobian, x, product)
    pattern = structure.pattern
    found = csc_array((jacobian, pattern.indices, pattern.indptr), shape=pattern.shape)
    assert product == pytest.approx(found @ x, rel=1e-12, abs=1e-12 * np.max(np.abs(found @ x)))
    return found.toarray()


@pytest.mark.parametrize(
    "law, scheme", [("linear", "upwind"), ("linear", "upwind5"), ("log", "muscl")]
)
def test_differences_by_color_are_those_state_by_state(law, scheme):
    model, rng = random_model(4, scheme, law), np.random.default_rng(4)
    colored, full = (
        Structure(jacobian_pattern(model)),
        Structure.full(model.y_size, len(model.node_names)),
    )
    assert colored.color_count < model.y_size / 2
    for t in TIMES:
        y = random_state(model, rng)
        one, other = slopes(model, t, y, colored), slopes(model, t, y, full)
        assert np.all(
            np.abs(one - other) <= 1e-5 * np.max(np.abs(other), axis=1, keepdims=True) + 1e-9
        )


@pytest.mark.in_turn
@pytest.mark.parametrize("scheme", ["upwind", "upwind5", "muscl"])
@pytest.mark.parametrize("law", ["linear", "log"])
def test_storage_in_slopes_is_their_supply(law, scheme):
    """Slopes of the rates, weighted with the mass per state, add up to the slopes of the supplies."""
    for seed in (0, 2):  # with friction and without
        model, rng = random_model(seed, scheme, law), np.random.default_rng(seed)
        n, weight = model.y_size, masses(model)
        structure = Structure(jacobian_pattern(model))
        for t in TIMES:
            y = random_state(model, rng)
            found, base = slopes(model, t, y, structure), rates(model, t, y)
            moved = 2.0**-26 * np.maximum(np.abs(y), model.scale)
            rounding = 1e-14 * (weight @ np.abs(base[:n]) + np.sum(np.abs(base[n:]))) / moved
            assert np.all(np.abs(weight @ found[:n] - np.sum(found[n:], axis=0)) <= rounding)


@pytest.mark.parametrize(
    "law, scheme", [("linear", "upwind"), ("linear", "central"), ("log", "upwind5")]
)
def test_every_kind_solves_steps_of_a_microsecond_and_of_minutes(law, scheme):
    """All kinds of linear algebra solve with the error 1e-7 from Courant numbers far below 1 to about 1e5.

    Newton's method needs much less, and the sparse kind does not exchange rows.
    """
    model, rng = random_model(3, scheme, law), np.random.default_rng(3)
    n, pattern = model.y_size, jacobian_pattern(model)
    entry = (pattern.indices, np.repeat(np.arange(n), np.diff(pattern.indptr)))
    for t in TIMES:
        found = slopes(model, t, random_state(model, rng), Structure(pattern))
        for shift in (1e-2, 1.0, 1e3, 1e6, 1e2 + 2e2j):
            b = model.scale * rng.normal(size=n)
            wanted = np.linalg.solve(shift * np.eye(n) - found[:n], b) / model.scale
            for kind in KINDS:
                structure, number = Structure(pattern, kind), type(shift)
                factor, solve = structure.functions(number is complex)
                store, x = np.zeros(structure.store_size, dtype=number), b.astype(number)
                assert factor(structure.shape, found[entry].copy(), shift, store) == 0
                solve(structure.shape, store, x)
                assert np.max(np.abs(x / model.scale - wanted)) < 1e-7 * np.max(np.abs(wanted))


def masses(model) -> np.ndarray:
    """Mass per unit of each state [kg]: dx / speed for waves, 1 for stored masses, 0 for flows of columns."""
    found = np.zeros(model.y_size)
    for row in model.tables.pipes:
        found[row["y"] : row["y"] + 2 * row["cells"]] = row["dx"] / row["speed"]
    stored = model.tables.nodes["y"]
    found[stored[stored >= 0]] = 1.0
    return found


ROUGH = {"model": "quasi-steady", "roughness": 1e-4}
FACTOR = {"model": "steady", "factor": 0.02}
CLOSING = {"time": [0.0, 1.0, 2.0, 3.0], "value": [1.0, 0.3, 2e-4, 0.0]}


def random_network(seed: int, scheme: str = "upwind", law: str = "linear", size: int = 7) -> dict:
    """Connected network of pipes, valves that shut from 0 to 3 s, rigid columns, vessels and two lakes.

    Networks with `seed` mod 3 equal to 2 are frictionless and start from rest.
    """
    rng, smooth = np.random.default_rng(seed), seed % 3 == 2
    nodes = {"L0": lake(40.0), "L1": lake(35.0)}
    links = {}
    for k in range(size):
        kind = rng.choice(["junction", "junction", "junction", "chamber", "tank"])
        made = {
            "junction": junction,
            "chamber": lambda: chamber(0.2),
            "tank": lambda: tank(2.0, 30.0),
        }[kind]()
        other = f"L{k}" if k < 2 else str(rng.choice(list(nodes)))
        nodes[f"N{k}"] = made
        links[f"p{k}"] = random_pipe(rng, other, f"N{k}", smooth)
    names = list(nodes)
    for k in range(size):
        a, b = (str(name) for name in rng.choice(names, 2, replace=False))
        if k % 3 == 0:
            links[f"q{k}"] = random_pipe(rng, a, b, smooth)
        else:
            links[f"v{k}"] = valve(a, b, 1e-3, CLOSING if rng.random() < 0.7 else 1.0)
    # at X valves can control a column, at Y they cannot
    nodes["X"], nodes["Y"] = junction(), junction()
    a, d = (str(name) for name in rng.choice(names, 2, replace=False))
    b, c = (str(name) for name in rng.choice(names, 2))
    column = {"type": "rigid-column", "length": 20.0, "diameter": 0.1, "friction": FACTOR}
    links["c0"] = column | {"from": a, "to": "X"}
    links["w0"], links["w1"] = valve("X", b, 1e-3, CLOSING), valve(c, "X", 1e-3, CLOSING)
    links["c1"] = column | {"from": "Y", "to": d}
    links["y"] = random_pipe(rng, a, "Y", smooth)
    numerics = {
        "scheme": scheme,
        "method": "ssp-rk3",
        "courant": 0.8,
        "initial": "rest" if smooth else "steady",
    }
    made = scene(nodes, links, 4.0, numerics)
    return made | {"fluid": {**made["fluid"], "law": law}}


def random_pipe(rng, start: str, end: str, smooth: bool) -> dict:
    """Pipe of one to twelve cells, frictionless if `smooth`, otherwise with one of two friction models."""
    friction = {"model": "none"} if smooth else (FACTOR, ROUGH)[rng.integers(2)]
    return pipe(start, end, 100.0, 0.2, 1000.0, int(rng.integers(1, 13)), friction=friction)


SOILS = {
    "constant": {"rate": 1e-5},
    "horton": {"initial": 6e-5, "final": 1e-5, "decay": 1e-2},
    "green-ampt": {"conductivity": 2e-6, "suction": 0.17, "deficit": 0.3},
}


@pytest.mark.parametrize("soil", SOILS)
def test_infiltration_depends_on_the_states_of_the_pattern_only(soil):
    basin = {
        "type": "basin",
        "size": [6.0, 4.0],
        "cells": [6, 4],
        "level": 0.3,
        "elevation": 0.0,
        "rain": 1e-5,
        "bed": "0.2*sin(x)*cos(y)",
        "infiltration": {"model": soil} | SOILS[soil],
    }
    numerics = {"scheme": "muscl", "method": "tr-bdf2", "step": 1.0}
    model = fvsolve.build(fvsolve.load(scene({"field": basin}, {}, 1.0, numerics)))
    y = np.abs(model.scale * np.random.default_rng(1).normal(size=model.y_size))
    assert stray(model, 0.2, y) < 1e-7
