"""Shipped cases run, satisfy their expectations and close their mass balance.

Hydraulic drive with air in its oil: motion against SciPy, natural frequency and energy balance.
"""

import math
import tomllib

import numpy as np
import pytest
from pytest import approx
from reference.air import ATM, AirOil, follow
from reference.folders import CASES

import fvsolve
from fvsolve.core.fluid import properties
from fvsolve.studies.energy_balance import energy

PATHS = sorted(CASES.glob("*.toml"))


def test_the_promised_cases_are_there():
    assert len(PATHS) >= 11


@pytest.mark.parametrize("path", PATHS, ids=lambda p: p.stem)
def test_a_shipped_case_satisfies_its_claims(path):
    written = tomllib.loads(path.read_text(encoding="utf-8"))
    assert written.get("title") and written.get("expect")
    # a change of a default must not change results
    assert {"scheme", "method"} <= written["numerics"].keys()
    result = fvsolve.run(path)
    assert result.ok, result.reason
    assert result.expectations
    assert [e for e in result.expectations if not e.ok] == []
    assert abs(result.ledger["mass"]["relative"]) < 1e-12


@pytest.mark.parametrize("path", PATHS, ids=lambda p: p.stem)
def test_a_shipped_case_begins(path):
    """Short form for the quick tests: the first hundredth of a case conserves mass and gives finite values."""
    case = fvsolve.load(path)
    numerics = case.numerics
    end = numerics.start + 0.01 * (numerics.end - numerics.start)
    result = fvsolve.run(path, {"numerics.end": end, "expect": {}, "compare": {}})
    assert result.reason == "finished"
    assert abs(result.ledger["mass"]["relative"]) < 1e-12
    assert all(np.isfinite(result[str(probe)]).all() for probe in result.probes)


CASE = CASES / "hydraulic-drive.toml"
BREAKS = (5e-3, 15e-3, 90e-3, 110e-3, 170e-3, 180e-3)
OPENING = (0.0, 1.0, 1.0, -0.6, -0.6, 0.0)
HOLE, AREAS, DEAD, STROKE, MASS = 0.65 * 12e-6, (12.5e-4, 8e-4), 30e-6, 0.2, 60.0
ENDS, START = (ATM + 100e5, ATM + 1e5), (ATM + 20e5, ATM + 25e5)


def oil(fraction: float = 0.01) -> tuple[AirOil, float]:
    """Law of the oil of the case, and its viscosity [Pa s]."""
    found = properties("ISO VG 46", 323.15, ATM)
    return AirOil(found.density, found.bulk_modulus, fraction, 1.4), found.viscosity


def edge(share: float, up: float, down: float, fluid: AirOil, viscosity: float) -> float:
    """Mass flow of a sharp edge [kg/s]; below Re = 10 of the full opening, the quintic of docs/parts/valve.md."""
    size = 2.0 * fluid.density(max(up, down)) * (HOLE * share) ** 2 * abs(up - down)
    slow = 10.0 * math.pi / 4.0 * math.sqrt(4.0 * 12e-6 / math.pi) * viscosity
    x = size / slow**2
    return math.copysign(
        math.sqrt(size) if x >= 1 else slow * x * (45 - 18 * x**2 + 5 * x**4) / 32, up - down
    )


def rates(t, y, fluid, viscosity):
    """Rates d/dt of (p_A, p_B, x, v)."""
    p_a, p_b, x, v = y
    s = float(np.interp(t, BREAKS, OPENING))
    feed, drain = (p_a, p_b) if s > 0 else (p_b, p_a)
    into, out = (
        edge(abs(s), ENDS[0], feed, fluid, viscosity),
        edge(abs(s), drain, ENDS[1], fluid, viscosity),
    )
    flows = (into, -out) if s > 0 else (-out, into)
    volumes = DEAD + AREAS[0] * x, DEAD + AREAS[1] * (STROKE - x)
    swept = AREAS[0] * v, -AREAS[1] * v
    gain = [flows[i] / fluid.density(p) - swept[i] for i, p in enumerate((p_a, p_b))]
    rise = [fluid.modulus_at(p) / volumes[i] * gain[i] for i, p in enumerate((p_a, p_b))]
    force = AREAS[0] * (p_a - ATM) - AREAS[1] * (p_b - ATM) - 800.0 * v - 1e4 * (x - 0.01)
    return [*rise, v, force / MASS]


def test_the_drive_moves_as_by_scipy():
    result = fvsolve.run(CASE)
    fluid, viscosity = oil()
    start = [*START, 0.06, 0.0]
    truth = follow(
        lambda t, y: rates(t, y, fluid, viscosity),
        start,
        result.t,
        [1.0, 1.0, 1e-12, 1e-10],
        BREAKS,
        1e-3,
    )
    truth[:2] = (truth[:2] - ATM) / 1e5
    truth[2] *= 1e3
    probes = ("cyl.A.gauge_pressure", "cyl.B.gauge_pressure", "load.position", "load.velocity")
    # [bar], [bar], [mm], [m/s]
    for probe, one, near in zip(probes, truth, (1e-3, 1e-3, 1e-3, 3e-6), strict=True):
        assert result[probe] == approx(one, abs=near), probe


@pytest.fixture(scope="module")
def truth_behind_the_shut_spool() -> np.ndarray:
    """Pressure of chamber B at 103 and 181 ms [Pa] by SciPy, with short steps while the spool is nearly shut."""
    fluid, viscosity = oil()
    apart = np.array([0.0, 5e-6, 1e-5, 2e-5, 5e-5, 1e-4])
    near = np.ravel([(t - apart, t + apart) for t in (102.5e-3, 180e-3)])
    times, rate = (
        np.union1d([0.0, *near, *BREAKS], [0.103, 0.181]),
        lambda t, y: rates(t, y, fluid, viscosity),
    )
    truth = follow(
        rate, [*START, 0.06, 0.0], times, [1.0, 1.0, 1e-12, 1e-10], sorted({*BREAKS, *near}), 1e-3
    )
    return truth[1, np.searchsorted(times, [0.103, 0.181])]


@pytest.mark.parametrize(
    "method", ["auto", "tsitouras", "verner-7", "rodas-4", "rodas-5p", "radau-iia-5", "esdirk-5"]
)
def test_flow_that_turns_laminar_as_the_spool_shuts_is_seen(method, truth_behind_the_shut_spool):
    """The flow is laminar for 15 us within a long step; five of these methods once agreed on an error of 20 Pa."""
    result = fvsolve.run(CASE, set={"numerics.method": method, "numerics.rtol": 1e-7})
    found = ATM + 1e5 * result["cyl.B.gauge_pressure"][[103, 181]]
    assert found == approx(truth_behind_the_shut_spool, abs=4.0)


def test_air_slows_the_swinging_by_the_root_of_the_bulk_modulus():
    """Small oscillation with shut ports: omega = sqrt(sum A^2 K_eff / (V m) + k / m)."""
    for fraction in (0.0, 0.01, 0.05):
        p, bare = ATM + 5e5, properties("ISO VG 46", 323.15, ATM).bulk_modulus
        modulus = oil(fraction)[0].modulus_at(p) if fraction else bare
        volumes = DEAD + AREAS[0] * 0.06, DEAD + AREAS[1] * 0.14
        stiff = sum(a**2 * modulus / v for a, v in zip(AREAS, volumes, strict=True))
        omega = math.sqrt((stiff + 1e4) / MASS)
        hold = (AREAS[0] - AREAS[1]) * 5e5 - 1e4 * (0.06 - 0.01)
        end = 20 * 2 * math.pi / omega
        changes = {
            "fluid.air_fraction": fraction,
            "links.spool.position": 0.0,
            "links.cyl.viscous_friction": 0.0,
            "links.cyl.initial_pressure_A": p,
            "links.cyl.initial_pressure_B": p,
            "nodes.load.initial_velocity": 1e-4,
            "links.push": {"type": "force", "from": "ground", "to": "load", "force": -hold},
            "numerics.end": end,
            "output.every": end / 2000,
            "numerics.rtol": 1e-10,
        }
        plain = {
            key: value for key, value in tomllib.loads(CASE.read_text()).items() if key != "expect"
        }
        result = fvsolve.run(plain, set=changes)
        x = result["load.position"] - 60.0
        up = np.flatnonzero((x[:-1] <= 0) & (x[1:] > 0))[1:]
        cross = result.t[up] - x[up] * (result.t[up + 1] - result.t[up]) / (x[up + 1] - x[up])
        assert 2 * math.pi / np.mean(np.diff(cross)) == approx(omega, rel=1e-3)


def test_the_drives_ledger_of_energy_closes():
    found = energy(CASE)
    assert found.ok and found.relative < 1e-6
    assert abs(fvsolve.run(CASE).ledger["mass"]["relative"]) < 1e-12
