"""Materials, pressure classes and restraint of pipes: values equal those of the sources, which the case names."""

import math

import pytest
from pytest import approx
from reference.scenes import junction, lake, pipe, scene

import fvsolve
from fvsolve import load
from fvsolve.errors import CaseError
from fvsolve.parts.pipe.catalogue import class_size, ductile
from fvsolve.parts.pipe.pipe_wall import Wall, materials, restraint_factor, sources

# SLR Pipeline, technical details: DN, DE, nominal wall of K9 and of the preferred C class [mm]
SLR = [
    (80, 98, 6.0, 4.4, 40), (100, 118, 6.0, 4.4, 40), (150, 170, 6.0, 4.5, 40), (200, 222, 6.3, 4.7, 40),
    (250, 274, 6.8, 5.5, 40), (300, 326, 7.2, 6.2, 40), (350, 378, 7.7, 6.3, 30), (400, 429, 8.1, 6.5, 30),
    (500, 532, 9.0, 7.5, 30), (600, 635, 9.9, 8.7, 30), (700, 738, 10.8, 8.8, 25), (800, 842, 11.7, 9.6, 25),
    (900, 945, 12.6, 10.6, 25), (1000, 1048, 13.5, 11.6, 25),
]  # fmt: skip
BEARS = {100: 64, 150: 64, 200: 62, 250: 54, 300: 49, 350: 45}  # pressures of K9 [bar]; Aquaflo, ductile iron pipe


def main(**more) -> dict:
    table = pipe("lake", "end", 1000.0, 0.3, 1000.0, 20) | more
    return {key: value for key, value in table.items() if key in more or key not in ("diameter", "wave_speed")}


def read(defaults=None, **more):
    top = {"defaults": {"pipe": defaults}} if defaults is not None else {}
    return load(scene({"lake": lake(50.0), "end": junction()}, {"main": main(**more)}, 1.0, {}, **top))


@pytest.mark.parametrize(("size", "outer", "nine", "preferred", "number"), SLR)
def test_walls_of_ductile_iron_are_those_that_a_maker_prints(size, outer, nine, preferred, number):
    for name, wall in (("K9", nine), (f"C{number}", preferred)):
        found = class_size(name, f"DN{size}", "ductile-iron")
        assert 1e3 * found.thickness == approx(wall, abs=0.101)  # both tables have one decimal
        assert 1e3 * found.diameter == approx(outer - 2e3 * found.thickness)


@pytest.mark.parametrize(("size", "bar"), BEARS.items())
def test_k9_bears_what_a_maker_prints(size, bar):
    assert round(1e-5 * class_size("K9", f"DN{size}", "ductile-iron").pressure) == bar


def test_c_classes_are_the_pressure_that_their_least_wall_bears():
    for outer, walls in ductile().values():
        for number, wall in walls.items():
            assert 20.0 * wall * 420.0 / ((outer - wall) * 3.0) >= number - 0.75  # walls in steps of 0.1 mm


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
def test_a_thick_wall_gives_way_as_lame_says(held):
    for ratio in (2.0, 8.0, 24.9):
        wall = Wall(youngs_modulus=1e9, thickness=1.0 / ratio, poisson_ratio=0.45)
        assert restraint_factor(held, 1.0, wall) == approx(lame(ratio, 0.45, held), rel=1e-13)
    thin = Wall(youngs_modulus=1e9, thickness=1e-4, poisson_ratio=0.3)
    expected = {"joints": 1.0, "upstream": 0.85, "anchored": 0.91}[held]
    assert restraint_factor(held, 1.0, thin) == approx(expected) == approx(lame(1e4, 0.3, held), rel=1e-3)


def test_without_restraint_the_wave_speed_is_the_old_one_to_the_bit():
    case = read(diameter=0.3, wall={"youngs_modulus": 2e9, "thickness": 0.03, "poisson_ratio": 0.4})
    fluid = case.properties
    assert case.wave_speed("main") == math.sqrt(1.0 / (1.0 / fluid.bulk_modulus + 0.3 / (2e9 * 0.03)) / fluid.density)
    assert read(diameter=0.3, wall={"youngs_modulus": 2e9, "thickness": 0.03}, restraint=1).wave_speed(
        "main"
    ) == approx(case.wave_speed("main"), rel=1e-14)


def test_a_lining_of_the_wall_s_own_stuff_is_a_thicker_wall():
    wall = {"youngs_modulus": 2e9, "thickness": 0.01}
    lined = read(diameter=0.3, wall=wall, lining={"youngs_modulus": 2e9, "thickness": 0.005})
    assert lined.wave_speed("main") == read(diameter=0.3, wall=wall | {"thickness": 0.015}).wave_speed("main")
    named = {"material": "ductile-iron", "class": "K9", "nominal": "DN300"}
    assert read(**named, lining={"youngs_modulus": 2e10, "thickness": "4 mm"}).links["main"].diameter == approx(0.3036)


def test_every_figure_names_the_page_it_was_read_on():
    for material in materials().values():
        for key, figure in material.figures.items():
            assert figure.least <= figure.used <= figure.greatest
            assert figure.sources and all(sources()[one] in figure.description for one in figure.sources)
            assert key not in material.missing_keys
    assert materials()["PE100"].figures["youngs_modulus"].used == 1.3e9  # the greatest of the sources


def test_the_pipe_says_whose_figures_it_has_and_reads_back():
    case = read(**{"material": "ductile-iron", "class": "K9"}, nominal="DN300", friction={"model": "quasi-steady"})
    found = case.links["main"]
    assert found.wall.youngs_modulus == 166.7e9 and found.friction.roughness == approx(0.125e-3)
    assert all(one in found.source for one in ("K9 DN300", "ISO 2531", "MAFF", "Idelchik"))
    assert load(case.table()) == case


def test_what_the_file_says_itself_stands():
    own = {"youngs_modulus": 165e9, "thickness": 0.009}
    case = read(**{"material": "ductile-iron", "class": "K9"}, nominal="DN300", wall=own, allowable_pressure="30 barg",
                friction={"model": "quasi-steady", "roughness": 1e-3}, source="own tests")  # fmt: skip
    found = case.links["main"]
    assert (found.wall.youngs_modulus, found.wall.thickness, found.friction.roughness) == (165e9, 0.009, 1e-3)
    assert (found.allowable_pressure, found.source) == (30e5, "own tests")


def test_what_was_not_read_is_refused_and_asked_for():
    for more, said in [
        ({"material": "stel", "diameter": 0.3}, 'unknown material "stel"; did you mean "steel"'),
        ({"material": "PEX", "diameter": 0.3}, "the catalogue has no data of PEX; leave `material` out"),
        ({"material": "steel", "diameter": 0.3}, "wall thickness of steel is missing"),
        ({"material": "PE100", "nominal": "DN110"}, "expected a class for PE100"),
        ({"class": "K9", "nominal": "DN300"}, 'expected material = "ductile-iron"'),
        ({"class": "K9", "diameter": 0.3}, "diameter and class are given; keep one"),
        ({"class": "K9", "nominal": "DN310", "material": "ductile-iron"}, "the nearest sizes are DN250, DN300, DN350"),
        ({"class": "C20", "nominal": "DN300", "material": "ductile-iron"}, "expected one of C100, C40, C50, C64"),
        ({"class": "X9", "nominal": "DN300"}, 'unknown class "X9"'),
        ({"class": "PN16", "nominal": "DN110", "material": "PVC-U"}, "Expected one of these materials, or a class"),
        ({"class": "SDR11", "nominal": "DN110", "material": "PE80", "restraint": "joints"}, "needs Poisson's ratio"),
        ({"diameter": 0.3, "restraint": "ancored"}, 'unknown restraint "ancored"'),
        ({"diameter": 0.3, "wave_speed": 1e3, "restraint": 1.0}, "wave_speed and restraint are given; keep one"),
    ]:
        with pytest.raises(CaseError, match=said.replace("(", r"\(")) as caught:
            read(**more)
        assert len(caught.value.faults) <= 2


def test_a_limit_takes_its_share_of_what_the_class_bears():
    settings = {"limits.class": {"on": "pipes", "class_fraction": 0.5}, "numerics.end": 5.0, "expect": {}}
    [found] = fvsolve.run("plastic-main", settings).verdicts
    assert found.limit == approx(8.0) and not found.ok and found.place == "lower"  # bar, half of PN16
