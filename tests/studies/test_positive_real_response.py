"""`fvsolve response`: ports of cases against closed forms, and verdicts that depend on the scheme."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest
from pytest import approx
from reference.scenes import NO_FRICTION, RHO, area, junction, lake, pipe, reservoir, scene

from fvsolve.errors import FvsolveError
from fvsolve.studies import LineImpedance, positive_real, response

BETA, VOLUME, HOLE, CD = 1.5e9, 0.02, 1e-6, 0.61
OIL = {"name": "user", "density": 870.0, "bulk_modulus": BETA, "viscosity": 0.03, "law": "linear"}


def bottle():
    """Case of a chamber filled through an orifice at a drop of 100 bar."""
    nodes = {
        "pump": reservoir(101e5),
        "bottle": {"type": "chamber", "volume": VOLUME, "initial_pressure": 1e5},
    }
    hole = {"type": "orifice", "from": "pump", "to": "bottle", "area": HOLE, "discharge_coefficient": CD}
    return scene(nodes, {"hole": hole}, 1.0, {"method": "dormand-prince", "rtol": 1e-8}, fluid=OIL)


RESISTANCE = 2.0 * 100e5 / (CD * HOLE * math.sqrt(2.0 * 100e5 / 870.0))  # d dp / dq = 2 dp / q
CAPACITY = VOLUME / BETA
W = np.array([1e-3, 0.1, 0.3, 1.0, 10.0])


def test_chamber_and_orifice_are_a_resistance_and_a_capacity():
    seen, fed = response(bottle(), "pump"), response(bottle(), "bottle")
    s = 1j * W
    assert np.allclose(seen(s), CAPACITY * s / (1.0 + RESISTANCE * CAPACITY * s), rtol=1e-7)
    assert np.allclose(fed(s), RESISTANCE / (1.0 + RESISTANCE * CAPACITY * s), rtol=1e-7)
    assert (seen.kind, fed.kind) == ("admittance", "impedance")
    assert seen.verdict.answer == fed.verdict.answer == "yes"
    assert positive_real([CAPACITY, 0], [RESISTANCE * CAPACITY, 1]) and positive_real([RESISTANCE], [1, 1])


WAVE, LENGTH, DIAMETER, CELLS = 1000.0, 1000.0, 0.5, 30


def line(scheme, port="gate", cells=CELLS, reverse=False, instead=None):
    """Response of a lossless pipe between a reservoir and a dead end."""
    ends = ("gate", "lake") if reverse else ("lake", "gate")
    pipe = {"type": "pipe", "from": ends[0], "to": ends[1], "length": LENGTH, "diameter": DIAMETER,
            "wave_speed": WAVE, "cells": cells, "friction": NO_FRICTION}  # fmt: skip
    case = scene({"lake": reservoir(1e6), "gate": junction()}, {"main": pipe}, 1.0, {"scheme": scheme, "method": "rk4"})
    return response(case, port, scheme=instead)


Z0 = RHO * WAVE / area(DIAMETER)


@pytest.mark.parametrize("reverse", [False, True])
def test_a_lossless_line_is_its_closed_form(reverse):
    s = 1j * np.array([0.2, 0.9, 1.4, 2.1, 3.0])
    open_, closed = LineImpedance(Z0, LENGTH / WAVE, -1.0), LineImpedance(Z0, LENGTH / WAVE, 1.0)
    assert np.allclose(line("upwind5", "gate", reverse=reverse)(s), open_(s), rtol=2e-5)
    assert np.allclose(line("upwind5", "lake", reverse=reverse)(s), 1.0 / closed(s), rtol=2e-5)


def test_upwind_biased_lines_are_positive_real_or_on_the_boundary_and_upwind_beyond_doubt():
    for port in ("gate", "lake"):
        assert line("upwind", port).verdict.answer == "yes"
        for scheme in ("fromm", "upwind3", "upwind5"):
            found = line(scheme, port).verdict
            assert found.positive_real in (True, None) and -1e-9 < found.margin < 1e-7, found.reason


def test_central_differences_break_positive_realness_and_a_direct_solve_says_so_too():
    found = line("central")
    dip = found.verdict.dips[0]
    assert found.verdict.answer == "no" and dip.angle < -1e-5
    direct = found.d + found.c @ np.linalg.solve(
        1j * dip.worst * np.eye(len(found.b)) - found.a, found.b.astype(complex)
    )
    assert direct.real == approx(dip.real, rel=1e-6) and direct.real < -1e-5 * abs(direct)


def test_friction_moves_a_line_off_the_boundary():
    pipe = {"type": "pipe", "from": "lake", "to": "gate", "length": LENGTH, "diameter": DIAMETER, "wave_speed": WAVE,
            "cells": CELLS, "friction": {"model": "steady", "factor": 0.02}}  # fmt: skip
    valve = {"type": "valve", "from": "gate", "to": "out", "area": 0.01, "opening": 1.0}
    nodes = {"lake": reservoir(1e6), "gate": junction(), "out": reservoir(2e5)}
    case = scene(nodes, {"main": pipe, "valve": valve}, 1.0, {"scheme": "upwind5", "method": "rk4"})
    assert response(case, "gate").verdict.margin > 1e-3
    # s -> 0: pipe and valve in parallel, each d dp / dq = 2 dp / q
    friction, loss = 0.02 * LENGTH / DIAMETER * RHO / (2.0 * area(DIAMETER) ** 2), RHO / (2.0 * (0.61 * 0.01) ** 2)
    q = math.sqrt(8e5 / (friction + loss))
    assert response(case, "gate")(0.0).real == approx(1.0 / (1.0 / (2 * friction * q) + 1.0 / (2 * loss * q)), rel=1e-6)


def test_ports_that_are_none_and_cases_that_are_too_large_are_refused():
    with pytest.raises(FvsolveError, match='no port named "gat"; did you mean "gate"'):
        line("upwind", "gat")
    with pytest.raises(FvsolveError, match="900 states.*fewer"):
        line("upwind", cells=450)
    with pytest.raises(FvsolveError, match="limited"):
        line("muscl")
    assert line("muscl", instead="fromm").scheme == "fromm"


def test_the_command_prints_one_object_and_leaves_table_and_pictures(tmp_path):
    command = [sys.executable, "-m", "fvsolve", "response", "chamber-and-orifice", "--port", "bottle", "--json"]
    done = subprocess.run([*command, "--out", str(tmp_path)], capture_output=True, text=True, check=True)
    said = json.loads(done.stdout)
    assert said["verdict"]["answer"] == "yes" and said["kind"] == "impedance" and len(said["A"]) == 1
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"bottle.response.{ending}" for ending in ("csv", "npz", "png", "svg")}
    rows = (tmp_path / "bottle.response.csv").read_text().splitlines()
    assert rows[0].startswith("frequency [Hz],w [rad/s],real") and len(rows) == len(said["frequency"]) + 1


def test_central_differences_are_not_positive_real_however_fine_the_cells():
    firsts, worst = [], []
    for cells in (20, 40):
        nodes = {"top": lake(50.0), "end": junction()}
        made = scene(nodes, {"p": pipe("top", "end", 600.0, 0.5, 1200.0, cells)}, 1.0, {"scheme": "central"})
        found = response(made, "top")
        a, eye = found.a, np.eye(len(found.a))
        w = max(found.verdict.dips, key=lambda dip: -dip.angle).worst
        h = found.d + found.c @ np.linalg.solve(1j * w * eye - a, found.b)
        firsts.append(found.verdict.dips[0].angle)
        worst.append(h.real / abs(h))
    assert firsts == pytest.approx([-9.1e-4, -1.146e-4], rel=0.02) and max(worst) < -0.25
