"""Density law `mixture`, liquid with free gas and vapour, compared with quadrature, closed forms and SciPy."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.air import ATM, AirOil, follow, orifice
from reference.refusals import refused
from reference.scenes import chamber, junction, pipe, ramp, reservoir, scene, valve
from scipy.integrate import quad

import fvsolve
from fvsolve.core.fluid import properties
from fvsolve.core.fluid.laws import MixtureLaw
from fvsolve.core.kernels import density as law
from fvsolve.core.kernels import dtypes as rec
from fvsolve.studies.energy_balance import energy

OIL = {"name": "user", "density": 870.0, "bulk_modulus": 1.6e9, "viscosity": 0.04}
MIXTURES = {
    "one per cent": {"air_fraction": 0.01},
    "adiabatic": {"air_fraction": 0.05, "gas_exponent": 1.4},
    "dissolving": {"air_fraction": 0.05, "saturation_pressure": 1e6},
    "dissolving, polytropic": {
        "air_fraction": 0.02,
        "saturation_pressure": 3e6,
        "gas_exponent": 1.2,
    },
    "cavitating": {"air_fraction": 1e-7, "cavitation": True, "vapor_pressure": 2339.0},
}
NONE = np.zeros(0)


def settings(**keys):
    """Record that kernels read, for oil with the mixture of `keys`."""
    fluid = properties(**{**OIL, "temperature": 293.15, "pressure": ATM, "law": "mixture", **keys})
    made = np.zeros(1, rec.SETTINGS)
    MixtureLaw.lower(fluid, made[0], [])
    return made[0]


def walled(compliance: float):
    pipe = np.zeros(1, rec.PIPE)[0]
    pipe["area"], pipe["compliance"] = 0.01, compliance
    return pipe


def integral(f, low: float, high: float, st) -> float:
    """Integral of f over pressure, in ln(p - floor), by quad at 1e-13."""
    floor = st["floor"]
    ends = math.log(low - floor), math.log(high - floor)
    kink = [math.log(st["saturation"])] if ends[0] < math.log(st["saturation"]) < ends[1] else None
    return quad(
        lambda y: math.exp(y) * f(floor + math.exp(y)),
        *ends,
        epsabs=0,
        epsrel=1e-13,
        limit=500,
        points=kink,
    )[0]


@pytest.mark.parametrize("compliance", [0.0, 2e-10, 2e-8], ids=["rigid", "steel", "plastic"])
@pytest.mark.parametrize("keys", MIXTURES.values(), ids=MIXTURES)
def test_mass_and_head_lead_back_to_their_pressure_over_nine_decades(keys, compliance):
    st, pipe = settings(**keys), walled(compliance)
    for x in np.logspace(-1.5, 7.5, 37):
        p = float(st["floor"] + x)
        m, _ = law.mass_of_pressure(st, NONE, pipe, p)
        there = law.pressure_of_mass(st, NONE, pipe, m)
        assert law.mass_of_pressure(st, NONE, pipe, there)[0] == approx(m, rel=1e-15)
        # abs: rounding of the mass by 1e-16 in liquid
        assert there - st["floor"] == approx(x, rel=1e-11, abs=1e-6)
        h = law.enthalpy(st, NONE, p)
        assert law.enthalpy(st, NONE, law.pressure_of_enthalpy(st, NONE, h)) == approx(
            h, rel=1e-14, abs=1e-12
        )
        dense = math.log(law.density(st, NONE, p) / st["rho"])
        assert law.pressure_of_log(st, NONE, 0.0, dense) - st["floor"] == approx(
            x, rel=1e-10, abs=1e-6
        )


@pytest.mark.parametrize("compliance", [0.0, 2e-8], ids=["rigid", "plastic"])
@pytest.mark.parametrize("keys", MIXTURES.values(), ids=MIXTURES)
def test_enthalpy_thrust_and_riemann_integral_are_integrals_to_twelve_digits(keys, compliance):
    """dh = dp / rho, dW = A dp, dv = dp / (rho c) with c^2 = A dp / dm, by adaptive quadrature."""
    st, pipe = settings(**keys), walled(compliance)
    low = float(st["floor"])
    for a, b in ((0.05, 2e7), (3e2, 9e4), (1.2e5, 1.3e5), (8e5, 2e6)):
        a, b = low + a, low + b
        h = law.enthalpy(st, NONE, b) - law.enthalpy(st, NONE, a)
        assert h == approx(integral(lambda p: 1 / law.density(st, NONE, p), a, b, st), rel=1e-11)
        force = law.thrust(st, NONE, pipe, b) - law.thrust(st, NONE, pipe, a)
        assert force == approx(
            integral(lambda p: law.wall_area(st, NONE, pipe, p), a, b, st), rel=1e-12
        )

        def lightness(p):
            m, dm = law.mass_of_pressure(st, NONE, pipe, p)
            return math.sqrt(dm * law.wall_area(st, NONE, pipe, p)) / m

        change = integral(lightness, a, b, st)
        assert law.velocity_change(st, NONE, pipe, a, b) == approx(change, rel=2e-12)
        assert law.velocity_change(st, NONE, pipe, b, a) == -law.velocity_change(
            st, NONE, pipe, a, b
        )


def test_the_riemann_integral_of_isothermal_gas_in_liquid_has_a_closed_form():
    """sqrt(v / K) (sqrt(p^2 + s^2) - s arsinh(s / p)), s^2 = K gas: over nine decades to 1e-12."""
    st = settings(air_fraction=0.01)
    s = math.sqrt(st["beta"] * st["gas"])

    def riemann(p):
        return (math.hypot(p, s) - s * math.asinh(s / p)) / math.sqrt(st["rho"] * st["beta"])

    for p in np.logspace(-2, 7, 10):
        found = law.velocity_change(st, NONE, walled(0.0), float(p), 3e7)
        assert found == approx(riemann(3e7) - riemann(p), rel=1e-12)


@pytest.mark.parametrize("keys", MIXTURES.values(), ids=MIXTURES)
def test_the_bulk_modulus_is_that_of_liquid_and_gas_in_series(keys):
    """1 / K_eff = (1 - g) / K_l + g / (n p) and the part that dissolves, with g the gas fraction of the volume."""
    st, floor = settings(**keys), keys.get("vapor_pressure", 0.0)
    oil = AirOil(
        870.0,
        1.6e9,
        keys["air_fraction"],
        keys.get("gas_exponent", 1.0),
        keys.get("saturation_pressure", math.inf),
        floor=floor,
    )
    found = []
    for p in floor + np.array([2e5, 5e5, 8e5, 2e6, 2e7]):
        assert law.density(st, NONE, p) == approx(oil.density(p), rel=1e-14)
        found.append(1.0 / law.log_density(st, NONE, p)[1])
        assert found[-1] == approx(oil.modulus_at(p), rel=1e-12)
    if keys["air_fraction"] > 1e-3:
        assert found[0] < found[1] < found[2] < found[3]


def test_a_bubbly_liquid_has_woods_speed_of_sound_two_orders_below_the_liquids():
    """1 / c^2 = rho (g / p + (1 - g) / K) (Wood 1930); at 1 atm the gas fraction is exactly `air_fraction`."""
    st = settings(air_fraction=0.01)
    assert law.density(st, NONE, ATM) == approx(0.99 * 870.0, rel=1e-14)
    c = law.local_speed(st, NONE, walled(0.0), ATM)
    assert c == approx(1 / math.sqrt(0.99 * 870.0 * (0.01 / ATM + 0.99 / 1.6e9)), rel=1e-12)
    st = settings(**MIXTURES["cavitating"])
    high, low = (law.local_speed(st, NONE, walled(0.0), 2339.0 + x) for x in (1e6, 1.0))
    assert high > 1300 and low < 0.01 * high


def test_gas_that_has_dissolved_leaves_the_bare_liquid():
    st, bare = settings(air_fraction=0.05, saturation_pressure=1e6), settings(air_fraction=1e-12)
    assert law.density(st, NONE, 1.5e6) == approx(law.density(bare, NONE, 1.5e6), rel=1e-13)
    assert law.density(st, NONE, ATM) == approx(0.95 * 870.0, rel=1e-14)
    assert law.density(st, NONE, 0.5 * ATM) < law.density(
        settings(air_fraction=0.05), NONE, 0.5 * ATM
    )


def main(fluid: dict, cells: int = 24) -> dict:
    """Case of a main before a valve that closes in part, with a chamber at its end."""
    nodes = {
        "lake": reservoir(2e6),
        "gate": junction(),
        "pot": chamber(1e-3),
        "out": reservoir(5e5),
    }
    links = {
        "main": pipe(
            "lake", "gate", 60.0, 0.05, 1200.0, cells, friction={"model": "steady", "factor": 0.03}
        )
    }
    links["tap"] = valve("gate", "out", 2e-4, ramp(0.02, 0.05, 1.0, 0.3))
    links["neck"] = valve("gate", "pot", 1e-5)
    settings = {"scheme": "weno5", "method": "rk4", "courant": 0.4}
    return scene(
        nodes,
        links,
        0.3,
        settings,
        ["gate.pressure", "pot.pressure", "main.flow@0.5"],
        0.01,
        fluid=fluid,
    )


def test_without_air_it_is_the_log_law_to_the_bit():
    fluid = {**OIL, "vapor_pressure": 1.0}
    bare, none = (fvsolve.run(main({**fluid, "law": one})) for one in ("log", "mixture"))
    zero = fvsolve.run(main({**fluid, "law": "mixture", "air_fraction": 0.0}))
    for probe in ("gate.pressure", "pot.pressure", "main.flow@0.5"):
        assert np.array_equal(bare[probe], none[probe]) and np.array_equal(bare[probe], zero[probe])


def test_a_little_air_is_the_log_law_but_for_the_strain():
    """The volume of the liquid is linear in pressure, at most dp / K = 3e-3 softer than under the log law."""
    log = fvsolve.run(main({**OIL, "vapor_pressure": 1.0, "law": "log"}))
    thin = fvsolve.run(main({**OIL, "vapor_pressure": 1.0, "law": "mixture", "air_fraction": 1e-9}))
    assert thin["gate.pressure"] == approx(log["gate.pressure"], rel=3e-3)


@pytest.mark.parametrize("keys", [MIXTURES[k] for k in ("one per cent", "adiabatic", "dissolving")])
def test_ledgers_of_mass_and_energy_close_with_air_in_pipes_and_chambers(keys):
    """The energy remainder is that of the scheme and falls with the cells; steps and law cause none."""
    fluid = {**OIL, "law": "mixture", **keys}
    result = fvsolve.run(main(fluid))
    assert result.ok and abs(result.ledger["mass"]["relative"]) < 1e-13
    coarse, fine = (energy(main(fluid, cells)) for cells in (16, 32))
    assert not coarse.law and fine.relative < min(0.5 * coarse.relative, 3e-4)
    assert np.sum([*fine.scheme.values(), fine.step, fine.newton], axis=0) == approx(
        fine.remainder, abs=1e-12 * fine.throughput
    )
    assert np.abs(fine.step).max() < 1e-6 * fine.throughput


@pytest.mark.parametrize(
    "keys", [{"air_fraction": 0.02}, {"air_fraction": 0.02, "gas_exponent": 1.4}]
)
def test_two_chambers_with_air_agree_with_scipy(keys):
    oil = AirOil(870.0, 1.6e9, 0.02, keys.get("gas_exponent", 1.0))
    volumes, holes, ends = (2e-3, 5e-3), (2e-7, 4e-7, 1e-7), (6e6, 3e5)

    def rates(t, y):
        flows = [
            orifice(hole, up, down, oil)
            for hole, up, down in zip(holes, (ends[0], *y), (*y, ends[1]), strict=True)
        ]
        return [
            oil.modulus_at(p) / oil.density(p) * (flows[i] - flows[i + 1]) / volumes[i]
            for i, p in enumerate(y)
        ]

    nodes = {
        "pump": reservoir(ends[0]),
        "a": chamber(volumes[0], 2e6),
        "b": chamber(volumes[1], 4e5),
    }
    nodes["sump"] = reservoir(ends[1])
    links = {
        "in": valve("pump", "a", holes[0]),
        "mid": valve("a", "b", holes[1]),
        "out": valve("b", "sump", holes[2]),
    }
    numerics = {"method": "dormand-prince", "rtol": 1e-12}
    fluid = {**OIL, "law": "mixture", **keys}
    result = fvsolve.run(
        scene(nodes, links, 0.8, numerics, ["a.pressure", "b.pressure"], 0.02, fluid=fluid)
    )
    truth = follow(rates, [2e6, 4e5], result.t, 1e-6)
    assert result["a.pressure"] == approx(truth[0], rel=1e-9)
    assert result["b.pressure"] == approx(truth[1], rel=1e-9)


BAD = {
    "air under another law": (
        {"law": "log", "air_fraction": 0.01},
        "air_fraction",
        'use law = "mixture"',
    ),
    "a cavity under another law": (
        {"law": "linear", "cavitation": True},
        "cavitation",
        'use law = "mixture"',
    ),
    "nothing but air": ({"law": "mixture", "air_fraction": 1.0}, "air_fraction", "below 1"),
    "less than no air": (
        {"law": "mixture", "air_fraction": -0.1},
        "air_fraction",
        "between 0 and 1",
    ),
    "cavities from nothing": (
        {"cavitation": True, "air_fraction": 0.0, "vapor_pressure": 2e3},
        "cavitation",
        "free gas",
    ),
    "cavities of what never boils": (
        {"law": "mixture", "cavitation": True, "air_fraction": 1e-6},
        "cavitation",
        "vapour pressure",
    ),
    "an adiabatic cavity": (
        {
            "law": "mixture",
            "cavitation": True,
            "air_fraction": 1e-6,
            "gas_exponent": 1.4,
            "vapor_pressure": 2e3,
        },
        "gas_exponent",
        "isothermal",
    ),
    "saturated at 1 atm": (
        {"law": "mixture", "air_fraction": 0.01, "saturation_pressure": 9e4},
        "saturation_pressure",
        "1 atm",
    ),
    "an exponent below 1": (
        {"law": "mixture", "air_fraction": 0.01, "gas_exponent": 0.9},
        "gas_exponent",
        "between 1",
    ),
    "a word for a flag": (
        {"law": "mixture", "cavitation": "yes"},
        "cavitation",
        "neither true nor false",
    ),
}


@pytest.mark.parametrize("keys, key, text", BAD.values(), ids=BAD)
def test_features_that_do_not_combine_are_refused_by_key(keys, key, text):
    case = main({**OIL, **keys})
    error = refused(case)
    assert f"fluid.{key}" in str(error) and text in str(error)


def test_gas_that_expands_too_far_for_the_scheme_is_reported_with_alternatives():
    nodes = {"up": reservoir(4e5), "g": junction(), "out": reservoir(2e5)}
    links = {
        "main": pipe("up", "g", 200.0, 0.3, 1000.0, 6),
        "gate": valve("g", "out", 0.01, ramp(0.1, 0.2, 1.0, 0.0)),
    }
    fluid = {"name": "Water", "law": "mixture", "air_fraction": 1e-3}
    result = fvsolve.run(scene(nodes, links, 5.0, {"rtol": 1e-6}, ["g.pressure"], 0.1, fluid=fluid))
    assert not result.ok and "cavitation = true" in result.reason
    fluid["cavitation"] = True
    result = fvsolve.run(
        scene(
            nodes, links, 5.0, {"rtol": 1e-6, "scheme": "muscl"}, ["g.pressure"], 0.1, fluid=fluid
        )
    )
    assert result.ok


def test_check_states_the_wave_speed_with_the_gas_of_the_start():
    """Wood's speed in a rigid pipe: 1 / c^2 = d rho / dp = rho (1 / beta + gas / p) / V^2, per volume of liquid."""
    air, p, beta, rho = 5e-3, 5e5, 2.2e9, 1000.0
    fluid = {
        "name": "user",
        "density": rho,
        "bulk_modulus": beta,
        "viscosity": 1e-3,
        "vapor_pressure": 2300.0,
    }
    fluid |= {"law": "mixture", "air_fraction": air}
    case = scene(
        {"a": reservoir(p), "b": junction()},
        {"line": pipe("a", "b", 100.0, 0.1, 1483.2396974, 10)},
        1.0,
        {},
        [],
    )
    found = fvsolve.build(fvsolve.load(case | {"fluid": fluid})).checks["pipes"]["line"]
    gas = air / (1.0 - air) * ATM / p
    volume = 1.0 - (p - ATM) / beta + gas
    assert found["wave_speed"] == approx(
        (rho * (1.0 / beta + gas / p) / volume**2) ** -0.5, rel=1e-6
    )
