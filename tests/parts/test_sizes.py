"""Nominal pipe sizes and fittings against printed tables and the package `fluids`, and faults of names."""

import math
import tomllib

import pytest
from fluids import nearest_pipe
from fluids.friction import ft_Crane
from pytest import approx
from reference.refusals import refused
from reference.scenes import AMBIENT, WATER, reservoir, scene

import fvsolve
from fvsolve.parts.conduit import FITTINGS, fittings_loss, pipe_bore

# ASME B36.10M: outer diameter and wall [mm]
PRINTED = {
    ("DN15", "40"): (21.3, 2.77), ("DN25", "80"): (33.4, 4.55), ("DN50", "40"): (60.3, 3.91),
    ("DN65", "40"): (73.0, 5.16), ("DN100", "40"): (114.3, 6.02), ("DN150", "80"): (168.3, 10.97),
    ("DN200", "40"): (219.1, 8.18), ("DN300", "STD"): (323.8, 9.53),
}  # fmt: skip
CRANE = {  # TP-410, pages: L / D
    "elbow-90": 30, "elbow-45": 16, "bend-90": 14, "mitre-90": 60, "tee-run": 20, "tee-branch": 60, "gate-valve": 8,
    "globe-valve": 340, "angle-valve": 55, "ball-valve": 3, "plug-valve": 18, "butterfly-valve": 45,
    "swing-check-valve": 100, "foot-valve": 420,
}  # fmt: skip


@pytest.mark.parametrize("size, schedule", PRINTED)
def test_nominal_sizes_are_those_of_the_printed_table(size, schedule):
    outer, wall = PRINTED[size, schedule]
    inner, thickness = pipe_bore(size, schedule)
    assert thickness == approx(wall * 1e-3, abs=2e-5)
    assert inner == approx((outer - 2 * wall) * 1e-3, abs=1e-4)


def test_dn_and_nps_are_two_names_of_one_size():
    for dn, nps in (("DN 100", "NPS 4"), ("dn32", "nps 1.25"), ("DN600", "NPS 24")):
        assert pipe_bore(dn, "40") == pipe_bore(nps, "40")
    assert pipe_bore("NPS 4", "80")[0] == nearest_pipe(NPS=4, schedule="80")[1]


@pytest.mark.parametrize("name", FITTINGS)
def test_fittings_lose_what_crane_prints(name):
    d = 0.10226
    if name == "entrance":
        assert fittings_loss([name], d) == 0.5
    elif name == "bend-45":  # K = (n - 1)(0.25 pi f_T r/d + 0.5 K) + K with n = 1/2 and K = 14 f_T at r/d = 1.5
        assert fittings_loss([name], d) == approx((14 - 0.5 * (0.25 * math.pi * 1.5 + 7)) * ft_Crane(d), rel=1e-2)
    else:
        assert fittings_loss([name], d) == approx(CRANE[name] * ft_Crane(d), rel=1e-2)
    assert ft_Crane(d) == approx(0.017, abs=1e-3)  # page A-26, NPS 4
    assert fittings_loss([name, name], d) == approx(2 * fittings_loss([name], d))


def line(**keys) -> dict:
    """Return a case of a short rigid column between two reservoirs, with losses by its fittings only."""
    column = {"type": "rigid-column", "from": "up", "to": "down", "length": 5.0, **keys}
    nodes = {"up": reservoir(AMBIENT + 2e4), "down": reservoir(AMBIENT)}
    return scene(nodes, {"line": column}, 0.1, {}, ["line.flow"], 0.05)


def test_a_line_with_fittings_carries_what_their_losses_let_through(tmp_path):
    """q = A sqrt(2 dp / (rho K)); the resolved case contains the numbers and gives the same flow."""
    case = line(nominal="DN100", fittings=["entrance", "elbow-90", "elbow-90", "globe-valve"], minor_loss=1.0)
    result = fvsolve.run(case, out=tmp_path / "out")
    d = pipe_bore("DN100", "40")[0]
    k = 1.0 + 0.5 + 400.0 * ft_Crane(d)
    assert result["line.flow"][0] == approx(math.pi / 4 * d**2 * math.sqrt(2 * 2e4 / (WATER["density"] * k)), rel=1e-9)
    said = tomllib.loads((tmp_path / "out" / "case.toml").read_text(encoding="utf-8"))["links"]["line"]
    assert said["diameter"] == d and said["minor_loss"] == approx(k, rel=1e-12)
    assert not {"nominal", "schedule", "fittings"} & said.keys()
    again = fvsolve.run(tmp_path / "out" / "case.toml")
    assert again["line.flow"][0] == result["line.flow"][0]


def test_the_wall_of_a_nominal_size_makes_its_wave_speed():
    """1 / K = 1 / beta + D / (E e) with e of the table, a = sqrt(K / rho)."""
    pipe = {"type": "pipe", "from": "up", "to": "down", "length": 50.0, "cells": 8, "nominal": "DN100",
            "wall": {"youngs_modulus": "200 GPa"}}  # fmt: skip
    case = fvsolve.load({**line(diameter=1.0), "nodes": {"up": reservoir(2e5), "down": reservoir(2e5)},
                         "links": {"line": pipe}})  # fmt: skip
    d, e = pipe_bore("DN100", "40")
    softness = 1 / WATER["bulk_modulus"] + d / (200e9 * e)
    assert fvsolve.build(case).pipes[0].wave_speed == approx(1 / math.sqrt(softness * WATER["density"]), rel=1e-12)


BAD = {
    "a size that is not made": ({"nominal": "DN110"}, "nominal", "the nearest sizes are NPS 4"),
    "no size": ({"nominal": "100 mm"}, "nominal", '"DN100", "NPS 4" or "NPS 1-1/2"'),
    "a schedule": ({"nominal": "DN100", "schedule": "45"}, "schedule", "did you mean"),
    "a schedule alone": ({"diameter": 0.1, "schedule": "40"}, "schedule", "keep one"),
    "both": ({"diameter": 0.1, "nominal": "DN100"}, "nominal", "keep one"),
    "neither": ({}, "line", "expected one of diameter, nominal"),
    "a near miss": ({"nominal": "DN100", "fittings": ["gate-vlave"]}, "fittings[0]", 'did you mean "gate-valve"?'),
    "not a list": ({"nominal": "DN100", "fittings": "gate-valve"}, "fittings", "not a list"),
    "a number": ({"nominal": 100}, "nominal", "100 is not text"),
}


@pytest.mark.parametrize("keys, key, text", BAD.values(), ids=BAD)
def test_a_name_that_means_nothing_is_one_fault_with_a_remedy(keys, key, text):
    error = refused(line(**keys))
    assert len(error.faults) == 1
    assert key in str(error) and text in str(error)


FRACTIONS = {
    "1/8": "0.125", "1/4": "0.25", "3/8": "0.375", "1/2": "0.5", "3/4": "0.75", "1-1/4": "1.25", "1-1/2": "1.5",
    "1 1/2": "1.5", "2-1/2": "2.5", "3 1/2": "3.5", "1 - 1/2": "1.5", "1 / 2": "0.5",
}  # fmt: skip


@pytest.mark.parametrize("said", FRACTIONS)
def test_a_fraction_names_the_size_that_its_decimal_does(said):
    assert pipe_bore(f"NPS {said}", "40") == pipe_bore(f"nps{FRACTIONS[said]}", "40") == nearest(FRACTIONS[said])


def nearest(inches: str) -> tuple[float, float]:
    found = nearest_pipe(NPS=float(inches), schedule="40")
    return found[1], found[3]


@pytest.mark.parametrize("said", ["NPS 1/0", "NPS 1/", "NPS /2", "NPS 1--1/2", "NPS 1/2/4", "NPS 1-1.5", "NPS -1/2"])
def test_what_is_no_fraction_is_no_size(said):
    with pytest.raises(ValueError, match="is not a nominal size"):
        pipe_bore(said, "40")
