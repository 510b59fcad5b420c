"""Pipe data equal those of their sources: materials, pressure classes, restraint, nominal sizes and fittings."""

import math
import tomllib

import pytest
from fluids import nearest_pipe
from fluids.friction import ft_Crane
from pytest import approx
from reference.refusals import refused
from reference.scenes import AMBIENT, WATER, junction, lake, pipe, reservoir, scene

import fvsolve
from fvsolve import load
from fvsolve.errors import CaseError
from fvsolve.parts.full_pipe import FITTINGS, fittings_loss, pipe_bore
from fvsolve.parts.pipe.catalogue import class_size, ductile
from fvsolve.parts.pipe.pipe_wall import Wall, materials, restraint_factor, sources

# SLR Pipeline, technical details: DN, DE, nominal wall of K9 and of the preferred C class [mm]
SLR = [
    (80, 98, 6.0, 4.4, 40), (100, 118, 6.0, 4.4, 40), (150, 170, 6.0, 4.5, 40), (200, 222, 6.3, 4.7, 40),
    (250, 274, 6.8, 5.5, 40), (300, 326, 7.2, 6.2, 40), (350, 378, 7.7, 6.3, 30), (400, 429, 8.1, 6.5, 30),
    (500, 532, 9.0, 7.5, 30), (600, 635, 9.9, 8.7, 30), (700, 738, 10.8, 8.8, 25), (800, 842, 11.7, 9.6, 25),
    (900, 945, 12.6, 10.6, 25), (1000, 1048, 13.5, 11.6, 25),
]  # fmt: skip
# pressures of K9 [bar]; Aquaflo, ductile iron pipe
BEARS = {100: 64, 150: 64, 200: 62, 250: 54, 300: 49, 350: 45}


def main(**more) -> dict:
    table = pipe("lake", "end", 1000.0, 0.3, 1000.0, 20) | more
    return {
        key: value
        for key, value in table.items()
        if key in more or key not in ("diameter", "wave_speed")
    }


def read(defaults=None, **more):
    top = {"defaults": {"pipe": defaults}} if defaults is not None else {}
    return load(
        scene({"lake": lake(50.0), "end": junction()}, {"main": main(**more)}, 1.0, {}, **top)
    )


@pytest.mark.parametrize(("size", "outer", "nine", "preferred", "number"), SLR)
def test_walls_of_ductile_iron_are_those_that_a_maker_prints(size, outer, nine, preferred, number):
    for name, wall in (("K9", nine), (f"C{number}", preferred)):
        found = class_size(name, f"DN{size}", "ductile-iron")
        assert 1e3 * found.thickness == approx(wall, abs=0.101)  # both tables have one decimal
        assert 1e3 * found.diameter == approx(outer - 2e3 * found.thickness)


@pytest.mark.parametrize(("size", "bar"), BEARS.items())
def test_k9_has_the_pressure_printed_by_a_manufacturer(size, bar):
    assert round(1e-5 * class_size("K9", f"DN{size}", "ductile-iron").pressure) == bar


def test_c_classes_are_the_pressure_of_their_least_wall():
    for outer, walls in ductile().values():
        for number, wall in walls.items():
            # walls in steps of 0.1 mm
            assert 20.0 * wall * 420.0 / ((outer - wall) * 3.0) >= number - 0.75


@pytest.mark.parametrize(("material", "name", "ratio", "bar"), [
    ("PE100", "SDR11", 11, 16.0), ("PE100", "SDR17", 17, 10.0), ("PE100", "SDR26", 26, 6.4),
    ("PE80", "SDR11", 11, 12.8), ("PE100", "PN16", 11, 16.0), ("PE100", "PN10", 17, 10.0),
    ("PE80", "PN 12.8", 11, 12.8),
])  # fmt: skip
def test_polyethylene_by_its_ratio_and_by_its_pressure(material, name, ratio, bar):
    found = class_size(name, "DN110", material)
    assert found.thickness == approx(0.110 / ratio)
    assert found.diameter == approx(0.110 - 0.220 / ratio)
    assert found.pressure == approx(1e5 * bar)


def lame(ratio: float, nu: float, held: str) -> float:
    """Restraint factor of a thick cylinder, from Lame's stresses at its bore for a pressure and a modulus of 1.

    ratio : D / e [-]; nu : Poisson's ratio [-]; held : restraint
    """
    a, b = 0.5 * ratio, 0.5 * ratio + 1.0
    hoop, radial, closed = (b * b + a * a) / (b * b - a * a), -1.0, a * a / (b * b - a * a)
    axial = {"joints": 0.0, "upstream": closed, "anchored": nu * (hoop + radial)}[held]
    return 2.0 * (hoop - nu * (radial + axial)) / ratio


@pytest.mark.parametrize("held", ["joints", "upstream", "anchored"])
def test_a_thick_wall_expands_by_lame(held):
    for ratio in (2.0, 8.0, 24.9):
        wall = Wall(youngs_modulus=1e9, thickness=1.0 / ratio, poisson_ratio=0.45)
        assert restraint_factor(held, 1.0, wall) == approx(lame(ratio, 0.45, held), rel=1e-13)
    thin = Wall(youngs_modulus=1e9, thickness=1e-4, poisson_ratio=0.3)
    expected = {"joints": 1.0, "upstream": 0.85, "anchored": 0.91}[held]
    assert (
        restraint_factor(held, 1.0, thin)
        == approx(expected)
        == approx(lame(1e4, 0.3, held), rel=1e-3)
    )


def test_without_restraint_the_wave_speed_is_the_previous_value_to_the_bit():
    case = read(diameter=0.3, wall={"youngs_modulus": 2e9, "thickness": 0.03, "poisson_ratio": 0.4})
    fluid = case.properties
    assert case.wave_speed("main") == math.sqrt(
        1.0 / (1.0 / fluid.bulk_modulus + 0.3 / (2e9 * 0.03)) / fluid.density
    )
    assert read(
        diameter=0.3, wall={"youngs_modulus": 2e9, "thickness": 0.03}, restraint=1
    ).wave_speed("main") == approx(case.wave_speed("main"), rel=1e-14)


def test_a_lining_of_the_wall_s_own_stuff_is_a_thicker_wall():
    wall = {"youngs_modulus": 2e9, "thickness": 0.01}
    lined = read(diameter=0.3, wall=wall, lining={"youngs_modulus": 2e9, "thickness": 0.005})
    assert lined.wave_speed("main") == read(
        diameter=0.3, wall=wall | {"thickness": 0.015}
    ).wave_speed("main")
    named = {"material": "ductile-iron", "class": "K9", "nominal": "DN300"}
    assert read(**named, lining={"youngs_modulus": 2e10, "thickness": "4 mm"}).links[
        "main"
    ].diameter == approx(0.3036)


def test_every_figure_names_the_page_it_was_read_on():
    for material in materials().values():
        for key, figure in material.figures.items():
            assert figure.least <= figure.used <= figure.greatest
            assert figure.sources and all(
                sources()[one] in figure.description for one in figure.sources
            )
            assert key not in material.missing_keys
    # the greatest of the sources
    assert materials()["PE100"].figures["youngs_modulus"].used == 1.3e9


def test_the_pipe_states_the_source_of_its_figures_and_reads_back():
    case = read(
        **{"material": "ductile-iron", "class": "K9"},
        nominal="DN300",
        friction={"model": "quasi-steady"},
    )
    found = case.links["main"]
    assert found.wall.youngs_modulus == 166.7e9 and found.friction.roughness == approx(0.125e-3)
    assert all(one in found.source for one in ("K9 DN300", "ISO 2531", "MAFF", "Idelchik"))
    assert load(case.table()) == case


def test_values_stated_in_the_file_take_precedence():
    own = {"youngs_modulus": 165e9, "thickness": 0.009}
    case = read(
        **{"material": "ductile-iron", "class": "K9"},
        nominal="DN300",
        wall=own,
        allowable_pressure="30 barg",
        friction={"model": "quasi-steady", "roughness": 1e-3},
        source="own tests",
    )
    found = case.links["main"]
    assert (found.wall.youngs_modulus, found.wall.thickness, found.friction.roughness) == (
        165e9,
        0.009,
        1e-3,
    )
    assert (found.allowable_pressure, found.source) == (30e5, "own tests")


def test_figures_that_were_not_read_are_refused_and_requested():
    for more, said in [
        ({"material": "stel", "diameter": 0.3}, 'unknown material "stel"; did you mean "steel"'),
        (
            {"material": "PEX", "diameter": 0.3},
            "the catalogue has no data of PEX; leave `material` out",
        ),
        ({"material": "steel", "diameter": 0.3}, "wall thickness of steel is missing"),
        ({"material": "PE100", "nominal": "DN110"}, "expected a class for PE100"),
        ({"class": "K9", "nominal": "DN300"}, 'expected material = "ductile-iron"'),
        ({"class": "K9", "diameter": 0.3}, "diameter and class are given; keep one"),
        (
            {"class": "K9", "nominal": "DN310", "material": "ductile-iron"},
            "the nearest sizes are DN250, DN300, DN350",
        ),
        (
            {"class": "C20", "nominal": "DN300", "material": "ductile-iron"},
            "expected one of C100, C40, C50, C64",
        ),
        ({"class": "X9", "nominal": "DN300"}, 'unknown class "X9"'),
        (
            {"class": "PN16", "nominal": "DN110", "material": "PVC-U"},
            "expected one of these materials, or a class",
        ),
        (
            {"class": "SDR11", "nominal": "DN110", "material": "PE80", "restraint": "joints"},
            "needs Poisson's ratio",
        ),
        ({"diameter": 0.3, "restraint": "ancored"}, 'unknown restraint "ancored"'),
        (
            {"diameter": 0.3, "wave_speed": 1e3, "restraint": 1.0},
            "wave_speed and restraint are given; keep one",
        ),
    ]:
        with pytest.raises(CaseError, match=said.replace("(", r"\(")) as caught:
            read(**more)
        assert len(caught.value.faults) <= 2


def test_a_limit_takes_its_share_of_the_pressure_of_the_class():
    settings = {
        "limits.class": {"on": "pipes", "class_fraction": 0.5},
        "numerics.end": 5.0,
        "expect": {},
    }
    [found] = fvsolve.run("plastic-main", settings).verdicts
    # bar, half of PN16
    assert found.limit == approx(8.0) and not found.ok and found.place == "lower"


# ASME B36.10M: outer diameter and wall [mm]
PRINTED = {
    ("DN15", "40"): (21.3, 2.77),
    ("DN25", "80"): (33.4, 4.55),
    ("DN50", "40"): (60.3, 3.91),
    ("DN65", "40"): (73.0, 5.16),
    ("DN100", "40"): (114.3, 6.02),
    ("DN150", "80"): (168.3, 10.97),
    ("DN200", "40"): (219.1, 8.18),
    ("DN300", "STD"): (323.8, 9.53),
}
CRANE = {  # TP-410, pages: L / D
    "elbow-90": 30,
    "elbow-45": 16,
    "bend-90": 14,
    "mitre-90": 60,
    "tee-run": 20,
    "tee-branch": 60,
    "gate-valve": 8,
    "globe-valve": 340,
    "angle-valve": 55,
    "ball-valve": 3,
    "plug-valve": 18,
    "butterfly-valve": 45,
    "swing-check-valve": 100,
    "foot-valve": 420,
}


@pytest.mark.parametrize("size, schedule", PRINTED)
def test_nominal_sizes_are_those_of_the_printed_table(size, schedule):
    outer, wall = PRINTED[size, schedule]
    inner, thickness = pipe_bore(size, schedule)
    assert thickness == approx(wall * 1e-3, abs=2e-5)
    assert inner == approx((outer - 2 * wall) * 1e-3, abs=1e-4)


def test_dn_and_nps_are_two_names_of_a_size():
    for dn, nps in (("DN 100", "NPS 4"), ("dn32", "nps 1.25"), ("DN600", "NPS 24")):
        assert pipe_bore(dn, "40") == pipe_bore(nps, "40")
    assert pipe_bore("NPS 4", "80")[0] == nearest_pipe(NPS=4, schedule="80")[1]


@pytest.mark.parametrize("name", FITTINGS)
def test_fittings_have_the_losses_printed_by_crane(name):
    d = 0.10226
    if name == "entrance":
        assert fittings_loss([name], d) == 0.5
    elif name == "bend-45":
        # K = (n - 1)(0.25 pi f_T r/d + 0.5 K) + K with n = 1/2 and K = 14 f_T at r/d = 1.5
        assert fittings_loss([name], d) == approx(
            (14 - 0.5 * (0.25 * math.pi * 1.5 + 7)) * ft_Crane(d), rel=1e-2
        )
    else:
        assert fittings_loss([name], d) == approx(CRANE[name] * ft_Crane(d), rel=1e-2)
    assert ft_Crane(d) == approx(0.017, abs=1e-3)  # page A-26, NPS 4
    assert fittings_loss([name, name], d) == approx(2 * fittings_loss([name], d))


def line(**keys) -> dict:
    """Return a case of a short rigid column between two reservoirs, with losses by its fittings only."""
    column = {"type": "rigid-column", "from": "up", "to": "down", "length": 5.0, **keys}
    nodes = {"up": reservoir(AMBIENT + 2e4), "down": reservoir(AMBIENT)}
    return scene(nodes, {"line": column}, 0.1, {}, ["line.flow"], 0.05)


def test_a_line_with_fittings_carries_the_flow_of_their_losses(tmp_path):
    """q = A sqrt(2 dp / (rho K)); the resolved case contains the numbers and gives the same flow."""
    case = line(
        nominal="DN100",
        fittings=["entrance", "elbow-90", "elbow-90", "globe-valve"],
        minor_loss=1.0,
    )
    result = fvsolve.run(case, out=tmp_path / "out")
    d = pipe_bore("DN100", "40")[0]
    k = 1.0 + 0.5 + 400.0 * ft_Crane(d)
    assert result["line.flow"][0] == approx(
        math.pi / 4 * d**2 * math.sqrt(2 * 2e4 / (WATER["density"] * k)), rel=1e-9
    )
    said = tomllib.loads((tmp_path / "out" / "case.toml").read_text(encoding="utf-8"))["links"][
        "line"
    ]
    assert said["diameter"] == d and said["minor_loss"] == approx(k, rel=1e-12)
    assert not {"nominal", "schedule", "fittings"} & said.keys()
    again = fvsolve.run(tmp_path / "out" / "case.toml")
    assert again["line.flow"][0] == result["line.flow"][0]


def test_the_wall_of_a_nominal_size_makes_its_wave_speed():
    """1 / K = 1 / beta + D / (E e) with e of the table, a = sqrt(K / rho)."""
    pipe = {
        "type": "pipe",
        "from": "up",
        "to": "down",
        "length": 50.0,
        "cells": 8,
        "nominal": "DN100",
        "wall": {"youngs_modulus": "200 GPa"},
    }
    case = fvsolve.load(
        {
            **line(diameter=1.0),
            "nodes": {"up": reservoir(2e5), "down": reservoir(2e5)},
            "links": {"line": pipe},
        }
    )
    d, e = pipe_bore("DN100", "40")
    softness = 1 / WATER["bulk_modulus"] + d / (200e9 * e)
    assert fvsolve.build(case).pipes[0].wave_speed == approx(
        1 / math.sqrt(softness * WATER["density"]), rel=1e-12
    )


BAD = {
    "a size that is not made": ({"nominal": "DN110"}, "nominal", "the nearest sizes are NPS 4"),
    "no size": ({"nominal": "100 mm"}, "nominal", '"DN100", "NPS 4" or "NPS 1-1/2"'),
    "a schedule": ({"nominal": "DN100", "schedule": "45"}, "schedule", "did you mean"),
    "a schedule alone": ({"diameter": 0.1, "schedule": "40"}, "schedule", "keep one"),
    "both": ({"diameter": 0.1, "nominal": "DN100"}, "nominal", "keep one"),
    "neither": ({}, "line", "expected one of diameter, nominal"),
    "a near miss": (
        {"nominal": "DN100", "fittings": ["gate-vlave"]},
        "fittings[0]",
        'did you mean "gate-valve"?',
    ),
    "not a list": ({"nominal": "DN100", "fittings": "gate-valve"}, "fittings", "not a list"),
    "a number": ({"nominal": 100}, "nominal", "100 is not text"),
}


@pytest.mark.parametrize("keys, key, text", BAD.values(), ids=BAD)
def test_an_unknown_name_is_a_single_fault_with_a_remedy(keys, key, text):
    error = refused(line(**keys))
    assert len(error.faults) == 1
    assert key in str(error) and text in str(error)


FRACTIONS = {
    "1/8": "0.125",
    "1/4": "0.25",
    "3/8": "0.375",
    "1/2": "0.5",
    "3/4": "0.75",
    "1-1/4": "1.25",
    "1-1/2": "1.5",
    "1 1/2": "1.5",
    "2-1/2": "2.5",
    "3 1/2": "3.5",
    "1 - 1/2": "1.5",
    "1 / 2": "0.5",
}


@pytest.mark.parametrize("said", FRACTIONS)
def test_a_fraction_names_the_size_that_its_decimal_does(said):
    assert (
        pipe_bore(f"NPS {said}", "40")
        == pipe_bore(f"nps{FRACTIONS[said]}", "40")
        == nearest(FRACTIONS[said])
    )


def nearest(inches: str) -> tuple[float, float]:
    found = nearest_pipe(NPS=float(inches), schedule="40")
    return found[1], found[3]


@pytest.mark.parametrize(
    "said", ["NPS 1/0", "NPS 1/", "NPS /2", "NPS 1--1/2", "NPS 1/2/4", "NPS 1-1.5", "NPS -1/2"]
)
def test_an_invalid_fraction_is_no_size(said):
    with pytest.raises(ValueError, match="is not a nominal size"):
        pipe_bore(said, "40")
