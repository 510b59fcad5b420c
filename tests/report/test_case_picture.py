"""Picture of a case before a run: networks, circuits and basins are drawn, with heads as computed at the start."""

import numpy as np
import pytest
from PIL import Image
from reference.flooded_valley import pool
from reference.scenes import junction, lake, pipe, scene

import fvsolve
from fvsolve.core.run import model_of
from fvsolve.report.case_picture import section_lines, write_case_picture
from fvsolve.report.long_section import paths_of, section_of, section_paths


@pytest.mark.parametrize(
    "case", ["pump-trip-air-vessel", "town-network", "two-tanks", "servo-axis", "street-and-sewer"]
)
def test_cases_are_drawn_before_a_run(case, fvs, tmp_path):
    out = tmp_path / "case.png"
    code, _, _ = fvs("check", case, "--picture", out)
    picture = np.asarray(Image.open(out), int)
    assert code == 0 and picture.shape[1] >= 1200
    assert (picture.sum(axis=2) < 300).sum() > 300  # ink


def test_heads_of_the_picture_are_those_of_the_run_at_its_start(tmp_path):
    nodes = {"top": lake("60 m"), "fork": junction(elevation="5 m"), "low": lake("20 m")}
    links = {
        "upper": pipe("top", "fork", 400.0, 0.3, 1000.0, 40),
        "lower": pipe("low", "fork", 600.0, 0.2, 1000.0, 60),
    }
    case = scene(nodes, links, 0.1, {}, ["fork.head"])
    model = model_of(fvsolve.load(case))
    pipes = {item.name: item for item in model.pipes}
    heads = {
        name: tuple(model.checks["nodes"][end]["head"] for end in (item.from_, item.to))
        for name, item in pipes.items()
    }
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    (way,) = section_paths(result)
    (drawn,) = paths_of(model.case, heads)
    assert way.places == drawn.places and way.legs == drawn.legs
    lines = section_lines(model, drawn, pipes, heads)
    section = section_of(result, way)
    head = np.interp(section.chainage, lines["chainage"], lines["head"])
    assert head == pytest.approx(section.along["initial_head"], abs=1e-3)
    height = np.interp(section.chainage, lines["chainage"], lines["elevation"])
    assert height == pytest.approx(section.along["elevation"], abs=1e-9)


def test_the_map_of_a_basin_shows_the_depth_at_the_start(tmp_path):
    from fvsolve.report.maps.flood_map import plan_of

    case = fvsolve.load(pool())
    depth = np.where(case.meshes["valley"].centre[:, 0] < 6.0, 1.2, 0.0)
    plan = plan_of(case, "valley", depth)
    assert plan.areas(plan.layers[0]).tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 72.0, 0.0]
    assert write_case_picture(model_of(case), tmp_path / "pool.png").is_file()


def test_another_kind_of_file_is_refused(fvs, tmp_path):
    code, _, said = fvs("check", "two-tanks", "--picture", tmp_path / "case.bmp")
    assert code == 2 and "expected a file name that ends in .png" in said
