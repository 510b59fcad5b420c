"""Maps of basins: classes, areas, packed rasters, places of shafts, coordinates, and early stops."""

import base64
import json
import re
import zlib

import numpy as np
import pytest
from reference.flooded_valley import pool

import fvsolve
from fvsolve.core.output.grid_files import frame_field
from fvsolve.core.output.node_places import node_places
from fvsolve.report.maps.flood_map import basin_frames, flood_map
from fvsolve.report.maps.map_classes import Classes, equal_classes, round_limit
from fvsolve.report.maps.map_figure import inward, map_figure
from fvsolve.report.maps.map_shapes import shapes_of
from fvsolve.report.maps.packed_levels import LEVELS, levels_of
from fvsolve.report.report_files import write_pictures, write_report

LIMITS = (0.01, 0.05, 0.1, 0.3, 0.5, 1.0, 2.0)


@pytest.fixture(scope="module")
def flooded(tmp_path_factory):
    return fvsolve.run(pool(), out=tmp_path_factory.mktemp("runs") / "pool", pictures=False)


def unpacked(text: str, plan) -> np.ndarray:
    """Levels of a packed raster, from the southern row."""
    raw = zlib.decompress(base64.b64decode(text))
    return np.frombuffer(raw, np.uint8).reshape(plan.cell.shape)[::-1]


@pytest.mark.parametrize(
    ("value", "number"),
    [
        (0.0, -1),
        (0.00999, -1),
        (0.01, 0),
        (0.04999, 0),
        (0.05, 1),
        (2.0, 6),
        (9.0, 6),
        (np.nan, -1),
    ],
)
def test_a_class_contains_its_lower_limit(value, number):
    classes = Classes(LIMITS, ("#000000",) * 7, "m")
    assert classes.of(np.array([value])) == [number]


@pytest.mark.parametrize("greatest", [0.3, 2.0, 2.5, 40.0])
def test_a_packed_level_has_the_class_and_nearly_the_value(greatest):
    classes = Classes(LIMITS, ("#000000",) * 7, "m")
    values = np.random.default_rng(5).uniform(0.0, greatest, 4000)
    values[:14] = [*LIMITS, *np.nextafter(LIMITS, 0.0)]
    values = np.minimum(values, max(greatest, 2.0))
    levels = levels_of(values, classes, greatest).astype(int)
    each = LEVELS // len(LIMITS)
    numbers = np.where(levels > 0, (levels - 1) // each, -1)
    assert np.array_equal(numbers, classes.of(values))
    ends = np.array([*LIMITS, max(greatest, LIMITS[-1])])
    known = levels > 0
    k, part = numbers[known], (levels[known] - 1) % each
    width = ends[k + 1] - ends[k]
    middle = ends[k] + (part + 0.5) / each * width
    assert (np.abs(middle - values[known]) <= 0.5001 * width / each + 1e-12).all()


@pytest.mark.parametrize(
    ("low", "high", "limits"),
    [
        (0.0, 60.0, (0.0, 10.0, 20.0, 30.0, 40.0, 50.0)),
        (3.0, 3.0, (1.5, 2.0, 2.5, 3.0, 3.5, 4.0)),
        (0.0, 0.0, (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4)),
    ],
)
def test_equal_classes_have_round_limits(low, high, limits):
    assert equal_classes(low, high, "min", ("#000000", "#ffffff")).limits == limits


def test_a_value_below_zero_by_rounding_needs_no_class():
    assert equal_classes(-1e-15, 0.8, "mg/l", ("#000000", "#ffffff")).limits[0] == 0.0


def test_a_basin_without_stored_values_is_named(tmp_path):
    case = pool()
    case["output"] = {"probes": ["valley.volume"], "fields": 0}
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    page = write_report(result.directory)[0].read_text()
    assert "No map of valley: neither greatest values nor frames were stored." in page


def test_limits_in_feet_are_round_numbers():
    feet = [round_limit(limit / 0.3048) for limit in (0.05, 0.1, 0.3, 0.5, 1.0, 2.0)]
    assert feet == [0.15, 0.3, 1.0, 1.5, 3.0, 7.0]


def test_areas_of_classes_are_those_of_the_greatest_depths(flooded):
    plan = flood_map(flooded, "valley")
    depth = plan.layers[0]
    deepest = flooded.maxima["valley"]["max_depth"]
    assert [layer.key for layer in plan.layers] == [
        "max_depth",
        "max_speed",
        "max_hazard",
        "arrival_time",
        "wet_duration",
    ]
    expected = [
        float(((deepest >= low) & (deepest < high)).sum())
        for low, high in zip(LIMITS, [*LIMITS[1:], np.inf], strict=True)
    ]
    assert plan.areas(depth).tolist() == expected
    assert sum(expected) > 50.0
    pixels = plan.class_numbers(depth)
    assert np.bincount(pixels[pixels >= 0], minlength=7).tolist() == expected
    for layer in plan.layers[1:]:
        assert plan.areas(layer).sum() == sum(expected)


def test_frames_of_the_page_have_the_depths_of_the_files(flooded):
    plan = flood_map(flooded, "valley")
    frames = map_figure(plan, flooded.case)["map"]["frames"]
    files = basin_frames(flooded)["valley"]
    assert frames["seconds"] == [t for t, _ in files] and frames["stored"] == len(files) == 6
    levels = np.zeros(plan.cell.shape, np.uint8)
    for text, (_, path) in zip(frames["data"], files, strict=True):
        levels = levels ^ unpacked(text, plan)
        depth = frame_field(path, "depth")[plan.cell]
        numbers = np.where(levels > 0, (levels.astype(int) - 1) // frames["each"], -1)
        assert np.array_equal(numbers, plan.frames.classes.of(depth))


def test_without_maxima_the_map_shows_the_greatest_of_the_frames(tmp_path):
    case = pool()
    del case["output"]["maxima"]
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    (layer,) = flood_map(result, "valley").layers
    stored = np.max(
        [frame_field(path, "depth") for _, path in basin_frames(result)["valley"]], axis=0
    )
    assert np.array_equal(layer.values, np.where(stored >= 0.01, stored, np.nan), equal_nan=True)
    assert "6 stored frames" in layer.source and "stored" in layer.name


def test_a_basin_that_is_never_dry_has_classes_of_equal_width(tmp_path):
    case = pool()
    case["nodes"]["valley"] |= {"bed": "-1", "start": {"level": "where(x < 6, 0.3, 0)"}}
    plan = flood_map(fvsolve.run(case, out=tmp_path / "run", pictures=False), "valley")
    limits = plan.layers[0].classes.limits
    assert limits == plan.frames.classes.limits and len(limits) >= 4
    assert np.ptp(np.diff(limits)) == pytest.approx(0.0, abs=1e-12) and limits[0] <= 1.0


def test_classes_in_feet_and_in_metres_draw_equal_maps(tmp_path):
    pixels = []
    for name, classes, units in (
        ("metres", ["30.48 cm", "60.96 cm"], {}),
        ("feet", ["1 ft", "2 ft"], {"level": "ft", "length": "ft"}),
    ):
        case = pool(report={"depth_classes": classes, "least_depth": "0.1 ft"})
        case["output"] = case["output"] | {"units": units}
        result = fvsolve.run(case, out=tmp_path / name, pictures=False)
        plan = flood_map(result, "valley")
        pixels.append(plan.class_numbers(plan.layers[0]))
        assert (
            plan.layers[0].classes.texts
            == {
                "metres": ["0.03048 to 0.3048", "0.3048 to 0.6096", "above 0.6096"],
                "feet": ["0.1 to 1", "1 to 2", "above 2"],
            }[name]
        )
    assert np.array_equal(*pixels) and (pixels[0] == 2).any()


def test_a_stated_least_depth_is_exact_in_feet(tmp_path):
    case = pool(report={"least_depth": "0.04 ft"})
    case["output"] = case["output"] | {"units": {"level": "ft", "length": "ft"}}
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    plan = flood_map(result, "valley")
    assert plan.layers[0].classes.limits == (0.04, 0.15, 0.3, 1.0, 1.5, 3.0, 7.0)
    wet = (result.maxima["valley"]["max_depth"] >= 0.04 * 0.3048).sum()
    assert plan.areas(plan.layers[0]).sum() == plan.areas(plan.layers[1]).sum() == wet


def test_coordinates_are_those_of_the_reference_system(tmp_path):
    case = pool()
    case["nodes"]["valley"] |= {"origin": [500000.0, 5300000.0], "crs": "EPSG:32632"}
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    plan = flood_map(result, "valley")
    assert plan.extent == pytest.approx((500000.0, 500024.0, 5300000.0, 5300012.0), abs=1e-6)
    layout = map_figure(plan, result.case)["layout"]
    assert layout["xaxis"]["title"]["text"] == "easting [m] (EPSG:32632)"


def test_a_slope_that_faces_the_sun_is_bright(flooded):
    """The sun is in the north-west; the valley has a side that faces north and another that faces south."""
    shade = flood_map(flooded, "valley").shade
    assert shade[2].mean() > shade[-3].mean() + 0.1


def test_conduits_lie_between_the_shafts_below_their_manholes():
    case = fvsolve.load(pool())
    places = node_places(case, "valley")
    assert places.at["upper"].tolist() == [15.5, 6.5] and places.at["lower"].tolist() == [20.5, 6.5]
    assert places.at["river"].tolist() == [28.5, 6.5] and places.assumed == {"river"}
    shapes = {(shape.kind, shape.name): shape for shape in shapes_of(case, "valley")}
    assert shapes["conduit", "sewer"].points.tolist() == [[15.5, 6.5], [20.5, 6.5]]
    assert not shapes["conduit", "sewer"].assumed and shapes["conduit", "outfall"].assumed
    assert shapes["gauge", "middle"].points.tolist() == [[12.5, 6.5]]
    assert {"patch", "section", "structure", "node", "gauge", "conduit"} == {
        kind for kind, _ in shapes
    }


def test_a_structure_ends_at_the_edge_of_a_map_if_the_place_of_the_next_basin_is_unknown():
    """Both basins of the road culvert begin at (0, 0), although they lie behind each other."""
    case = fvsolve.load("road-culvert")
    for basin, x in (("above", 28.0), ("below", 0.0)):
        shapes = {shape.name: shape for shape in shapes_of(case, basin)}
        assert shapes["under"].points.tolist() == [[x, 6.0]]
    beside = fvsolve.load(
        "road-culvert",
        set={"nodes.above.position": [0.0, 0.0], "nodes.below.position": [40.0, 0.0]},
    )
    shapes = {shape.name: shape for shape in shapes_of(beside, "below")}
    assert shapes["under"].points.tolist() == [[-12.0, 6.0], [0.0, 6.0]]


def test_a_pipe_without_stated_end_leads_out_of_the_basin():
    case = pool()
    case["nodes"]["sea"] = {"type": "reservoir", "elevation": "-1 m", "head": "-0.5 m"}
    case["nodes"]["valley"]["patches"]["west"] = {"side": "west"}
    case["links"]["drain"] = {
        "type": "rigid-column",
        "from": "valley.west",
        "to": "sea",
        "length": "10 m",
        "diameter": "0.3 m",
    }
    places = node_places(fvsolve.load(case), "valley")
    assert places.at["sea"].tolist() == [-10.0, 6.0] and "sea" in places.assumed


def test_places_do_not_depend_on_the_order_and_direction_of_links():
    case = pool()
    turned = pool()
    turned["links"] = dict(reversed(turned["links"].items()))
    for link in turned["links"].values():
        link["from"], link["to"] = link["to"], link["from"]
        if "inverts" in link:
            link["inverts"] = link["inverts"][::-1]
    first, second = (node_places(fvsolve.load(item), "valley") for item in (case, turned))
    assert first.assumed == second.assumed and first.at.keys() == second.at.keys()
    for name, place in first.at.items():
        assert second.at[name] == pytest.approx(place)


def test_maps_of_a_run_that_stopped_early_state_the_stop(tmp_path):
    case = pool(numerics={"end": "4 s", "method": "euler", "step": "0.5 s"})
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    assert not result.ok and result.reason != "finished"
    plan = flood_map(result, "valley")
    assert plan.stopped.startswith("The run stopped at t = ") and result.reason in plan.stopped
    notes = map_figure(plan, result.case)["layout"]["annotations"]
    assert plan.stopped.split(":")[0] in notes[0]["text"]
    page = write_report(tmp_path / "run")[0].read_text()
    assert re.search('<span class="stopped">The run stopped at', page)


def test_plot_writes_a_map_of_each_quantity(flooded, fvs, tmp_path):
    code, out, _ = fvs("plot", flooded.directory, "--map", "--out", tmp_path)
    keys = ["max_depth", "max_speed", "max_hazard", "arrival_time", "wet_duration"]
    assert code == 0
    assert out.split() == [str(tmp_path / f"map-valley-{key}.png") for key in keys]
    assert all((tmp_path / f"map-valley-{key}.png").stat().st_size > 20_000 for key in keys)


def test_a_new_run_deletes_the_maps_of_an_earlier_run(fvs, tmp_path):
    fvsolve.run(pool(), out=tmp_path / "run", pictures=False)
    assert fvs("plot", tmp_path / "run", "--map")[0] == 0
    assert len([*(tmp_path / "run").glob("map-*.png")]) == 5
    fvsolve.run(pool(), out=tmp_path / "run", pictures=False, force=True)
    assert not [*(tmp_path / "run").glob("map-*.png")]


def test_without_a_basin_there_is_no_map(tmp_path):
    result = fvsolve.run("two-tanks", out=tmp_path / "run", pictures=False)
    with pytest.raises(fvsolve.FvsolveError, match="no map to draw: the case has neither a basin"):
        write_pictures(result.directory, maps=True)
    assert '"map-0"' not in write_report(result.directory)[0].read_text()


def test_conduits_are_no_parts_of_their_own_in_the_model_table(flooded):
    page = write_report(flooded.directory)[0].read_text()
    assert "Chain(" not in page
    data = json.loads(re.search(r'id="figures">(.*?)</script>', page, re.S)[1])
    assert list(data)[0] == "map-0" and "map-1" not in data


@pytest.mark.parametrize(
    ("numerics", "text"),
    [
        ({"end": "4 s"}, "The run finished at t = 4 s."),
        ({"end": "4 s", "method": "euler", "step": "0.5 s"}, "The run stopped early at t = "),
    ],
    ids=["finished", "stopped"],
)
def test_files_of_grids_state_the_end_of_the_run(numerics, text, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    from scipy.io import netcdf_file

    grid = {"basin": "valley", "fields": ["max_depth"], "cell": "1 m"}
    case = pool(numerics=numerics)
    case["output"] = case["output"] | {
        "grids": {"a": grid | {"format": "geotiff"}, "b": grid | {"format": "netcdf"}}
    }
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    with rasterio.open(tmp_path / "run/grids/a-max_depth.tif") as file:
        tags = file.tags()
    assert tags["RUN"].startswith(text) and tags["TITLE"] == "Pool"
    with netcdf_file(tmp_path / "run/grids/b.nc", mmap=False) as file:
        assert file.comment.decode() == tags["RUN"]
    assert result.reason == "finished" or result.reason in tags["RUN"]


@pytest.mark.parametrize(
    ("x", "expected"),
    [(0.0, "top right"), (0.5, "top right"), (10.0, "top center"), (19.9, "top left")],
)
def test_names_near_an_edge_of_a_map_point_inward(x, expected):
    assert inward("top center", x, (0.0, 20.0, 0.0, 8.0)) == expected
