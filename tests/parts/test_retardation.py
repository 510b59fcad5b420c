"""Retardation: walls of pipes that store a scalar or heat, as an exact shift, with their own line in the ledger."""

import copy
import math
from importlib import import_module

import numpy as np
import pytest
from pytest import approx
from reference.dyed_pipes import (
    BORE,
    FLOW,
    SPEED,
    at_end,
    case_of,
    given,
    hammer,
    line,
    ogata_banks,
)
from reference.heated_fluid import CP, heated
from reference.orders import observed_order
from reference.reacting_scalars import moles
from reference.scenes import (
    RHO,
    area,
    junction,
    pipe,
    ramp,
    reservoir,
    scene,
    smooth_ramp,
    smooth_step,
    step,
)

import fvsolve
from fvsolve.features.scalars.modes import pipe_scalar_modes
from fvsolve.parts.pipe.pipe_wall import materials

R = 1.288  # of the steel pipe of Liege
SLOWER = {"retardation": {"dye": R}}
METHODS = (
    {"method": "ssp-rk3", "courant": 0.5},
    {"method": "radau-iia-5", "rtol": 1e-8},
    {"method": "rodas-5p", "rtol": 1e-7},
    {"method": "auto", "rtol": 1e-7},
)


def front(cells: int, **numerics) -> float:
    """L1 error of a smooth front in a pipe with R, which travels at velocity / R."""
    nodes = {"lake": given(dye=smooth_ramp(0.5, 5.0, 0.0, 1.0)), "tap": junction(FLOW)}
    _, found = at_end(
        case_of(nodes, {"a": line("lake", "tap", 8.0, cells, **SLOWER)}, 7.5, numerics)
    )
    x = (np.arange(20 * cells) + 0.5) * 8.0 / (20 * cells)
    exact = np.array([smooth_step(7.5 - place * R / SPEED, 0.5, 5.0) for place in x])
    return np.abs(found["a"]["dye"] - exact.reshape(cells, 20).mean(axis=1)).mean()


@pytest.mark.parametrize("scheme, order", [("upwind", 1.0), ("muscl", 2.0), ("weno5", 2.0)])
def test_a_front_travels_at_the_velocity_over_r_to_the_order_of_the_scheme(scheme, order):
    many = (40, 80, 160)
    errors = [front(cells, scheme=scheme) for cells in many]
    assert errors[-1] < {1.0: 0.02, 2.0: 3e-4}[order]
    assert -observed_order(errors, many) == approx(order, abs=0.2)


@pytest.mark.parametrize("method", ["euler", "ssp-rk3", "radau-iia-5"])
def test_values_are_those_without_a_wall_at_times_divided_by_r(method):
    """Decay, diffusion and the velocity are divided by R: steps that are R times as long give the same values."""
    found = []
    for factor in (1.0, R):
        nodes = {
            "lake": given(dye=smooth_ramp(0.5 * factor, 2.0 * factor, 0.0, 1.0)),
            "tap": junction(FLOW),
        }
        links = {"a": line("lake", "tap", 4.0, 20, retardation={"dye": factor})}
        case = case_of(nodes, links, 2.4 * factor, decay=0.2, ambient=0.3, diffusivity=0.02)
        case["numerics"] = {
            "scheme": "muscl",
            "method": method,
            "step": 6e-3 * factor,
            "end": 2.4 * factor,
        }
        found.append(at_end(case)[1]["a"]["dye"])
    assert found[0].max() > 0.6 and found[1] == approx(found[0], abs=1e-12)


def test_a_factor_of_1_is_to_the_bit_no_factor():
    cases = [
        hammer("muscl", {"model": "quasi-steady", "roughness": 1e-4}, initial=0.2, decay=0.1)
        for _ in range(2)
    ]
    cases[0]["nodes"] = cases[1]["nodes"] = {
        **cases[0]["nodes"],
        "lake": reservoir(5e5, scalars={"dye": 1.0}),
    }
    del cases[0]["links"]["b"]["retardation"]
    cases[1]["links"]["b"]["retardation"] = {"dye": 1.0}
    first, second = (fvsolve.run(case) for case in cases)
    assert (
        np.array_equal(first["gate.dye"], second["gate.dye"])
        and first.ledger["dye"] == second.ledger["dye"]
    )
    assert "wall" not in first.ledger["dye"]


def test_fluid_and_wall_have_their_own_lines_in_the_ledger():
    """Each content also follows from its length, and both from the delay of the front at the outlet."""
    nodes = {"lake": given(dye=step(1.0, 0.0, 2.0)), "tap": junction(FLOW)}
    case = case_of(
        nodes, {"a": line("lake", "tap", 4.0, 40, **SLOWER)}, 12.0, probes=["lake.dye", "tap.dye"]
    )
    case["output"]["every"] = 0.01
    result = fvsolve.run(case)
    book, mass = result.ledger["dye"], RHO * area(BORE) * 4.0
    assert book["fluid"]["initial"] == book["wall"]["initial"] == 0.0
    assert book["fluid"]["final"] == approx(2.0 * mass, rel=1e-4)
    assert book["wall"]["final"] == approx((R - 1.0) * 2.0 * mass, rel=1e-4)
    assert book["wall"]["final"] / book["fluid"]["final"] == approx(R - 1.0, rel=1e-12)
    assert book["final"] == approx(book["fluid"]["final"] + book["wall"]["final"], rel=1e-15)
    delayed = RHO * FLOW * np.trapezoid(result["lake.dye"] - result["tap.dye"], result.t)
    assert book["final"] == approx(delayed, rel=1e-3)
    assert (
        book["inflow"] - book["outflow"] == approx(book["final"], rel=1e-12)
        and book["relative"] < 1e-12
    )


@pytest.mark.parametrize("numerics", METHODS, ids=lambda item: item["method"])
def test_the_lines_close_through_water_hammer_with_decay_and_diffusion(numerics):
    """The amounts in fluid and walls equal those of the values and masses of cells, under explicit and other steps."""
    case = hammer(
        "upwind", {"model": "none"}, initial=0.2, decay=0.3, ambient=0.1, diffusivity=0.01
    )
    case["nodes"] = {
        **case["nodes"],
        "lake": reservoir(ramp(0.3, 0.2, 5e5, 1e5), scalars={"dye": 1.0}),
    }
    case["links"]["v"]["opening"] = 1.0
    case["numerics"] = {"scheme": "upwind", "end": 0.6, **numerics}
    book = fvsolve.run(case).ledger["dye"]
    assert book["relative"] < 1e-12 and book["decayed"] > 0.0
    model = fvsolve.build(fvsolve.load(case))
    state = fvsolve.advance(model, fvsolve.initial_state(model), 0.6)
    found = model.fields(state.y, model.evaluate(state.t, state.y)[1])
    wall = (R - 1.0) * RHO * area(0.1) * 40.0 * found["b"]["dye"].mean()
    assert book["wall"]["final"] == approx(wall, rel=1e-9)
    fluid = 0.0
    for name, (length, bore, speed) in {
        "a": (60.0, 0.1, 1000.0),
        "b": (40.0, 0.1, 1200.0),
        "side": (10.0, 0.05, 1000.0),
    }.items():
        masses = (
            RHO
            * area(bore)
            * (1.0 + (found[name]["pressure"] - model.case.properties.pressure) / (RHO * speed**2))
        )
        fluid += length * np.mean(masses * found[name]["dye"])
    box = found["nodes"]["box"]
    fluid += (
        0.05 * RHO * (1.0 + (box["pressure"] - model.case.properties.pressure) / 2.2e9) * box["dye"]
    )
    assert book["fluid"]["final"] == approx(fluid, rel=1e-6)


def test_methods_give_the_same_values():
    case = hammer(
        "upwind",
        {"model": "quasi-steady", "roughness": 1e-4},
        initial=0.2,
        decay=0.1,
        diffusivity=0.01,
    )
    case["nodes"] = {**case["nodes"], "lake": reservoir(5e5, scalars={"dye": 1.0})}
    ends = []
    for numerics in METHODS:
        case["numerics"] = {"end": 0.6, "scheme": "upwind", **numerics}
        ends.append(fvsolve.run(case)["gate.dye"][-1])
    assert ends[1:] == approx([ends[0]] * 3, rel=1e-5)


def test_direction_and_division_of_a_pipe_do_not_matter():
    """A pipe from its other end, in two halves and cut by a junction on it, with flow that reverses."""
    found = {}
    for form in ("whole", "back", "halves"):
        nodes = {
            "lake": given(dye=step(1.0, 0.0, 1.0)),
            "tap": junction(ramp(2.0, 2.0, FLOW, -0.5 * FLOW)),
        }
        links = {
            "a": line(*(("tap", "lake") if form == "back" else ("lake", "tap")), 4.0, 40, **SLOWER)
        }
        if form == "halves":
            links = {
                "a": line("lake", "mid", 2.0, 20, **SLOWER),
                "b": line("mid", "tap", 2.0, 20, **SLOWER),
            }
            nodes["mid"] = junction()
        fields = at_end(case_of(nodes, links, 6.0, {"scheme": "upwind"}))[1]
        values = np.concatenate([fields[name]["dye"] for name in links])
        found[form] = values[::-1] if form == "back" else values
    assert found["whole"].max() > 0.5
    assert found["back"] == approx(found["whole"], abs=1e-12)
    assert found["halves"] == approx(found["whole"], abs=1e-9)


def test_pieces_of_a_cut_pipe_keep_the_factor_of_the_pipe_also_from_defaults():
    nodes = {
        "lake": given(),
        "tap": junction(FLOW),
        "mid": {"type": "junction", "on": "a", "at": "1 m"},
    }
    case = case_of(nodes, {"a": line("lake", "tap", 4.0, 40)}, 1.0) | {"defaults": {"pipe": SLOWER}}
    del case["links"]["a"]["cells"]
    case = fvsolve.load(case)
    assert [case.retardation(name, "dye") for name in case.links] == [R, R]


def test_decay_and_diffusion_are_per_unit_of_fluid():
    """At rest the rate is decay / R; in steady flow the loss on the way does not depend on the wall."""
    nodes = {"left": given(), "stop": junction()}
    case = case_of(
        nodes,
        {"a": line("left", "stop", 1.0, 10, **SLOWER)},
        10.0,
        {"method": "rk4"},
        initial=50.0,
        decay=0.2,
        ambient=20.0,
    )
    assert at_end(case)[1]["a"]["dye"] == approx(20.0 + 30.0 * math.exp(-2.0 / R), rel=1e-9)
    nodes = {"lake": given(dye=60.0), "tap": junction(FLOW)}
    links = {"a": line("lake", "tap", 10.0, 100, **SLOWER)}
    _, found = at_end(case_of(nodes, links, 40.0, initial=60.0, decay=0.1, ambient=10.0))
    assert found["nodes"]["tap"]["dye"] == approx(10.0 + 50.0 * math.exp(-1.0), abs=2e-3)
    nodes["lake"] = given(dye=1.0)
    _, found = at_end(case_of(nodes, links, 4.0 * R, diffusivity=0.25))
    x = (np.arange(100) + 0.5) * 0.1
    assert np.abs(found["a"]["dye"] - ogata_banks(x, 4.0, 0.25)).mean() < 1e-3


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5"])
def test_reactions_take_place_in_the_fluid_only(method):
    """A + B at rest, with A in the wall too and R a = b: A has a / (1 + k a t), B stays R times A, atoms are kept."""
    k, a = 0.3, 2.0
    links = {"a": line("left", "stop", 1.0, 4, retardation={"A": R, "T": 2.0})}
    scalars = {**moles(A=a, B=R * a), "P": {"unit": "mol/m3"}, "T": {"initial": 9.0}}
    case = scene(
        {"left": given(), "stop": junction()},
        links,
        5.0,
        {"method": method, "rtol": 1e-10},
        ["a.A@0.5", "a.B@0.5", "a.P@0.5", "a.T@0.5", "reactions.pair.rate"],
        0.5,
        scalars=scalars,
        reactions={"pair": {"equation": "A + B -> P", "forward": k}},
    )
    result = fvsolve.run(case)
    exact = a / (1.0 + k * a * result.t)
    assert result["a.A@0.5"] == approx(exact, rel=1e-8)
    assert result["a.B@0.5"] == approx(R * exact, rel=1e-8)
    assert result["a.P@0.5"] == approx(R * (a - exact), abs=1e-8)
    assert result["a.T@0.5"] == approx(9.0, rel=1e-13)
    assert result["reactions.pair.rate"] == approx(k * R * exact**2 * area(BORE) * 1.0, rel=1e-7)
    assert all(result.ledger[name]["relative"] < 1e-12 for name in "ABP")


def test_friction_warms_fluid_and_wall_together():
    """Far behind the inlet the temperature rises by P / (m cp R); later the rise at the outlet is dp / (rho cp)."""
    nodes = {
        "in": {"type": "inflow", "flow": 3e-4, "scalars": {"temperature": 40.0}},
        "lake": given(),
    }
    links = {
        "line": pipe(
            "in",
            "lake",
            2.0,
            0.01,
            1000.0,
            10,
            friction={"model": "steady", "factor": 0.03},
            retardation={"temperature": 2.0},
        )
    }
    numerics, probes = {"scheme": "muscl", "method": "ssp-rk2"}, ["line.temperature@1"]
    case = heated(nodes, links, 10.0, ["line"], numerics, probes)
    case["output"]["every"] = 0.05
    result = fvsolve.run(case)
    rise, velocity = 0.03 * 2.0 / 0.01 * 0.5 * (3e-4 / area(0.01)) ** 2 / CP, 3e-4 / area(0.01)
    early = (result.t > 0.0) & (result.t < 0.25 * 2.0 * 2.0 / velocity)
    warmed = rise * velocity / 2.0 / 2.0 * result.t
    assert early.sum() > 3 and result["line.temperature@1"][early] - 40.0 == approx(
        warmed[early], rel=1e-4
    )
    assert result["line.temperature@1"][-1] - 40.0 == approx(rise, rel=1e-9)
    book = result.ledger["temperature"]
    assert (
        book["heat"]["line"] == approx(rise * CP * RHO * 3e-4 * 10.0, rel=1e-6)
        and book["relative"] < 1e-12
    )


STEEL = {"youngs_modulus": 2e11, "thickness": "3.91 mm", "density": 7850, "specific_heat": 476.0}
WATER = {"name": "user", "density": 994.0, "bulk_modulus": 2.2e9}


def heat(wall, **more) -> dict:
    table = {
        **line("lake", "tap", 39.0, 20),
        "diameter": "52.48 mm",
        "retardation": {"warm": "wall"},
        **more,
    }
    table = {
        key: value for key, value in {**table, "wall": wall}.items() if key not in ("wave_speed",)
    }
    scalars = {"warm": {"unit": "degC", "specific_heat": 4179.0}}
    return scene(
        {"lake": given(), "tap": junction(1e-4)},
        {"a": table},
        1.0,
        {},
        fluid=WATER,
        scalars=scalars,
    )


def test_the_factor_of_heat_follows_from_wall_and_lining():
    """1 + rho' c' A' / (rho c A); A' from the outer and the inner circle of each layer."""
    content, bore = 994.0 * 4179.0 * area(0.05248), 0.05248
    ring = 7850.0 * 476.0 * (area(bore + 2 * 0.00391) - area(bore))
    assert fvsolve.load(heat(STEEL)).retardation("a", "warm") == approx(
        1.0 + ring / content, rel=1e-12
    )
    assert 1.0 + ring / content == approx(R, abs=1e-3)  # figure of the measured pipe
    mortar = {
        "youngs_modulus": 2e10,
        "thickness": "5 mm",
        "density": "2.2 g/cm3",
        "specific_heat": "1 kJ/kg/K",
    }
    ring = 7850.0 * 476.0 * (area(bore + 0.01 + 2 * 0.00391) - area(bore + 0.01))
    ring += 2200.0 * 1000.0 * (area(bore + 0.01) - area(bore))
    assert fvsolve.load(heat(STEEL, lining=mortar)).retardation("a", "warm") == approx(
        1.0 + ring / content, rel=1e-12
    )
    named = fvsolve.load(heat({"thickness": "3.91 mm"}, material="steel"))
    steel = materials()["steel"].figures
    assert named.links["a"].wall.specific_heat == steel["specific_heat"].used == 468.0
    assert "specific heat 468 J/kg/K" in named.links["a"].source
    found = fvsolve.build(named).checks["pipes"]["a"]["retardation"]["warm"]
    assert found - 1.0 == approx(ring_of(steel) / content, rel=1e-12)
    assert fvsolve.load(named.table()).retardation("a", "warm") == found


def ring_of(steel) -> float:
    return steel["density"].used * 468.0 * (area(0.05248 + 2 * 0.00391) - area(0.05248))


def test_the_specific_heat_of_the_fluid_is_looked_up():
    case = heat(STEEL)
    case["fluid"], case["scalars"] = (
        {"name": "Water", "temperature": "35 degC"},
        {"warm": {"unit": "K"}},
    )
    assert fvsolve.load(case).retardation("a", "warm") == approx(R, abs=2e-3)


def test_the_limit_of_steps_by_transport_is_r_times_as_long():
    nodes = {"lake": given(dye=1.0), "tap": junction(FLOW)}
    limits = []
    for factor in (1.0, 2.0):
        links = {"a": line("lake", "tap", retardation={"dye": factor})}
        model = fvsolve.build(fvsolve.load(case_of(nodes, links, 1.0, decay=0.1, diffusivity=0.1)))
        limits.append(pipe_scalar_modes(model)[0][1])
    assert limits[0] == approx(2.0 * limits[1], rel=1e-12)


def test_a_run_interrupted_and_resumed_is_the_uninterrupted_run(tmp_path, monkeypatch):
    monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), "CHUNK_SECONDS", 0.0)
    nodes = {"lake": given(dye=step(1.0, 0.0, 1.0)), "tap": junction(FLOW)}
    case = case_of(nodes, {"a": line("lake", "tap", 4.0, 100, **SLOWER)}, 4.0, decay=0.1)

    def interrupt(t, seconds, steps):
        if t > 1.5:
            raise KeyboardInterrupt

    assert not fvsolve.run(case, out=tmp_path / "run", progress=interrupt, pictures=False).ok
    again = fvsolve.run(case, out=tmp_path / "run", resume=True, pictures=False)
    assert (
        again.ledger["dye"] == fvsolve.run(case).ledger["dye"]
        and again.ledger["dye"]["wall"]["final"] > 0.0
    )


LINK = ("links", "a")
FAULTS = [
    ((*LINK, "retardation"), {"worm": 1.2}, 'no scalar named "worm"; did you mean "warm"?'),
    ((*LINK, "retardation", "warm"), 0.9, "expected a value of at least 1"),
    (
        (*LINK, "retardation", "warm"),
        "steel",
        '"steel" is not a number; expected a number of at least 1, or "wall"',
    ),
    ((*LINK, "retardation"), 1.3, "is not a table of scalars; expected { NAME = VALUE }"),
    (
        (*LINK, "wall"),
        {"youngs_modulus": 2e11, "thickness": 0.004},
        '"wall" needs wall.density and wall.specific_heat',
    ),
    (
        (*LINK, "wall"),
        "rigid",
        '"wall" needs wall = { youngs_modulus, thickness, density, specific_heat }',
    ),
    (
        (*LINK, "lining"),
        {"youngs_modulus": 2e10, "thickness": 0.005},
        '"wall" needs lining.density and lining.specific',
    ),
    (
        ("scalars", "warm"),
        {"unit": "mg/l"},
        '"wall" is the heat in a wall, and warm has the unit "mg/l"',
    ),
    (("scalars", "warm"), {"unit": "K"}, 'a "user" fluid has none; give the key `specific_heat`'),
    (
        (*LINK, "retardation", "warm"),
        1.5,
        "specific_heat: needs heat = true, or a pipe with the retardation factor",
    ),
    ((*LINK, "pipe_model"), "delay-line", "scalars are carried in cells"),
    ((*LINK, "pipe_model"), "quasi-steady", "it has no volume to carry scalars"),
    ((*LINK, "type"), "rigid-column", "retardation: unknown key"),
]


@pytest.mark.parametrize(
    "keys, value, said",
    FAULTS,
    ids=[f"{'.'.join(keys)}-{k}" for k, (keys, *_) in enumerate(FAULTS)],
)
def test_impossible_settings_are_refused(keys, value, said):
    case = copy.deepcopy(heat(STEEL))
    fvsolve.build(fvsolve.load(case))
    table = case
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    with pytest.raises(fvsolve.CaseError) as error:
        fvsolve.build(fvsolve.load(case))
    assert said in str(error.value)
