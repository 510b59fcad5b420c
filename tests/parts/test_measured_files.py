"""CSV files: values are read as written, or the fault names the line; separators, commas, units, encodings."""

import time

import numpy as np
import pytest
from pytest import approx
from reference.refusals import refused
from reference.scenes import lake, scene, tank, valve

import fvsolve
from fvsolve.core.mesh import rectangle
from fvsolve.errors import MeshError
from fvsolve.features.basins.transport.lower import face_flows
from fvsolve.parts.csv_rows import read_columns
from fvsolve.parts.formula import SpatialFieldKey
from fvsolve.parts.value import ReadContext

T, H = [0.0, 0.5, 1.25], [45.7, -46.1, 1234.5]


def columns(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return read_columns(path, keys(), "head", ReadContext())[:2]


def keys(**stated):
    """Keys of a file of a time series, without values unless stated."""
    return {key: stated.get(key) for key in ("time", "value", "sheet", "date_order", "time_zone")}


def refusal(path, text, encoding="utf-8"):
    with pytest.raises(ValueError) as refused:
        columns(path, text, encoding)
    return str(refused.value)


@pytest.mark.parametrize(
    "mark, point", [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]
)
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_numbers_are_read_whatever_parts_them(mark, point, ending, tmp_path):
    rows = [f"{a}{mark}{b}".replace(".", point) for a, b in zip(T, H, strict=True)]
    t, head = columns(tmp_path / "rig.csv", ending.join([f"t [s]{mark}H [m]", *rows]))
    assert t.tolist() == T and head.tolist() == H


@pytest.mark.parametrize("header", ["t [s];p, measured [m]", '"t [s]";"H, [m]"'])
def test_a_comma_in_a_header_parts_no_columns(header, tmp_path):
    t, head = columns(tmp_path / "rig.csv", f"{header}\n0;45,7\n1;46,1\n")
    assert t.tolist() == [0.0, 1.0] and head.tolist() == [45.7, 46.1]


@pytest.mark.parametrize("header, scale", [("t (min),H (cm)", 0.01), ("t [min],H (measured)", 1.0)])
def test_round_brackets_may_contain_the_unit(header, scale, tmp_path):
    t, head = columns(tmp_path / "rig.csv", f"{header}\n0,45.7\n1,46\n")
    assert t.tolist() == [0.0, 60.0] and head == approx([45.7 * scale, 46.0 * scale], rel=1e-15)


def test_numbers_in_quotes_may_have_commas(tmp_path):
    t, head = columns(tmp_path / "rig.csv", 't [s],H [m]\n"0,0","45,7"\n"0,5","46,1"\n')
    assert t.tolist() == [0.0, 0.5] and head.tolist() == [45.7, 46.1]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_other_encodings_of_spreadsheets_are_read(encoding, tmp_path):
    t, head = columns(tmp_path / "rig.csv", "t [s];H [m]\n0;45,7\n1;46\n", encoding)
    assert t.tolist() == [0.0, 1.0] and head.tolist() == [45.7, 46.0]


@pytest.mark.parametrize("text, words", {
    "decimal commas between commas": (
        "t [s],H [m]\n0,0,45,7\n0,1,46,1\n",
        "line 2: 4 cells under 2 headers; with decimal",
    ),
    "one of them": ("t [s],H [m]\n0,45,7\n1,46,1\n", "line 2: 3 cells under 2 headers; with decimal commas"),
    "one of them under a comma at the end": ("t [s],H [m],\n0,45,7\n1,46,1\n", 'line 2: "7" has no header'),
    "only further down": ("t [s],H [m]\n0,45\n1,46,1\n", "line 3: 3 cells under 2 headers; with decimal commas"),
    "a row too short": ("t,H,p\n0,45,1\n1,46\n", "line 3: 2 cells under 3 headers"),
    "a row too long": ("t;H\n0;45\n1;46;3\n", "line 3: 3 cells under 2 headers"),
    "another separator": ("t,H\n0;45\n1;46\n", "line 2: 1 cell under 2 headers"),
    "units of their own": (
        "t,H\ns,m\n0,45\n",
        'line 2: "s" is not a number in column "t"; expected units in the header',
    ),
    "both commas and points": (
        "t;H\n0;1.234\n1;1,2\n",
        'line 3: "1,2" has a decimal comma, but numbers above have decimal points',
    ),
    "thousands": ("t;H\n0;1.234,5\n", '"1.234,5" is not a number'),
    "many thousands": ("t;H\n0;1,234,500\n", '"1,234,500" is not a number'),
    "underscores": ("t,H\n0,1_000\n", '"1_000" is not a number'),
    "nothing": ("t,H\n0,\n", '"" is not a number in column "H"'),
    "not a number": ("t,H\n0,nan\n", '"nan" is not a number'),
    "too great a number": ("t,H\n0,1e999\n", '"1e999" is not a number'),
    "one name twice": ("t,H,H\n0,1,2\n", None),
}.items())  # fmt: skip
def test_ambiguous_files_are_refused_with_their_line(text, words, tmp_path):
    text, words = words
    if words:
        assert words in refusal(tmp_path / "rig.csv", text)
    else:
        (tmp_path / "rig.csv").write_text(text)
        with pytest.raises(ValueError, match='has 2 columns "H"'):
            read_columns(tmp_path / "rig.csv", keys(time="t", value="H"), "head", ReadContext())


def test_bytes_that_are_no_text_are_named(tmp_path):
    assert "rig.csv is not UTF-8 or UTF-16 text" in refusal(
        tmp_path / "rig.csv", "t,Hö\n0,1\n", "latin-1"
    )
    (tmp_path / "rig.csv").write_bytes(b"PK\x03\x04\x00\x00\x00\x00\x12\x00\x00\x00\n1\n")
    with pytest.raises(ValueError, match="not UTF-8 or UTF-16 text"):
        read_columns(tmp_path / "rig.csv", keys(), "head", ReadContext())


def test_a_measured_series_with_decimal_commas_is_compared_as_measured(tmp_path):
    (tmp_path / "rig.csv").write_text("t [s];H [m]\n0,0;5,25\n0,5;5,25\n1,0;5,25\n")
    nodes = {"lake": lake(5.0), "pond": tank(1.0, 5.0)}
    case = scene(
        nodes,
        {"gate": valve("lake", "pond", 0.01)},
        1.0,
        {"rtol": 1e-6},
        ["lake.head"],
        compare={"lake.head": {"file": str(tmp_path / "rig.csv")}},
    )
    (found,) = fvsolve.run(case).comparisons
    assert found.points == 3 and found.rms == approx(0.25, rel=1e-12)
    (tmp_path / "rig.csv").write_text("t [s],H [m]\n0,0,5,25\n0,5,5,25\n")
    refused(case, r"line 2: 4 cells under 2 headers; with decimal commas")


@pytest.mark.parametrize("text", [
    "x,y,bed\n0,0,1.5\n10,0,1.5\n0,10,1.5\n", "x [m];y [m];bed [m]\n0,0;0,0;1,5\n10;0;1,5\n0;10;1,5\n",
    "x [cm];y [dm];bed [mm]\n0;0;1500\n1000;0;1500\n0;100;1500\n",
])  # fmt: skip
def test_points_of_a_bed_are_read_in_their_units(text, tmp_path):
    (tmp_path / "bed.csv").write_text(text)
    bed = SpatialFieldKey("length").read({"file": "bed.csv"}, ReadContext(folder=tmp_path))
    assert bed.at(np.array([1.0, 9.0, 30.0]), np.array([1.0, 0.5, 30.0])) == approx([1.5] * 3)
    (tmp_path / "bed.csv").write_text("x,y,bed\n0,0,1,5\n")
    with pytest.raises(ValueError, match="line 2: 4 cells under 3 headers; with decimal commas"):
        SpatialFieldKey("length").read({"file": "bed.csv"}, ReadContext(folder=tmp_path))


@pytest.mark.parametrize("order", ["by rows", "by columns", "mixed"])
def test_points_on_a_rectangular_grid_are_interpolated_bilinearly_and_others_in_triangles(
    order, tmp_path
):
    def shape(x, y):
        return 1.0 + 0.5 * x - y + 0.25 * x * y

    x, y = (q.ravel() for q in np.meshgrid([0.0, 1.0, 3.0], [-1.0, 0.0, 0.5, 2.0]))
    at = {
        "by rows": np.arange(12),
        "by columns": np.lexsort((y, x)),
        "mixed": np.random.default_rng(3).permutation(12),
    }
    table = np.column_stack([x, y, shape(x, y)])[at[order]]
    places = np.array([0.3, 2.9, 1.0, -5.0, 9.0, 0.5]), np.array([-0.9, 1.7, 0.5, 0.25, -3.0, 7.0])

    def read(rows):
        np.savetxt(
            tmp_path / "bed.csv", rows, delimiter=",", header="x [m],y [m],bed [m]", comments=""
        )
        return (
            SpatialFieldKey("length")
            .read({"file": "bed.csv"}, ReadContext(folder=tmp_path))
            .at(*places)
        )

    inside = np.clip(places[0], 0.0, 3.0), np.clip(places[1], -1.0, 2.0)
    assert read(table) == approx(shape(*inside), rel=1e-14)
    scattered = read(table[table[:, 2] != table[5, 2]])  # without one point they form no grid
    assert (
        scattered[0] != approx(shape(0.3, -0.9), rel=1e-3)
        and np.isin(scattered[3:], table[:, 2]).all()
    )


@pytest.mark.parametrize("text", [
    "x,y,u,v\n-9,-9,0.5,0\n9,-9,0.5,0\n-9,9,0.5,0\n9,9,0.5,0\n",
    "x [cm];y [m];u [cm/s];v [m/s]\n-900;-9;50,0;0\n900;-9;50;0\n-900;9;50;0\n900;9;50;0\n",
])  # fmt: skip
def test_velocities_are_read_alike(text, tmp_path):
    mesh = rectangle((1.0, 1.0), (2, 2))
    (tmp_path / "v.csv").write_text(text)
    assert face_flows(mesh, {"file": tmp_path / "v.csv"}) == approx(
        0.5 * mesh.normal[:, 0] * mesh.length, abs=1e-15
    )
    (tmp_path / "v.csv").write_text("x,y,u,v\n0,0,0,5,0,0\n")
    with pytest.raises(MeshError, match="line 2: 6 cells under 4 headers; with decimal commas"):
        face_flows(mesh, {"file": tmp_path / "v.csv"})


@pytest.mark.parametrize("sign", [" ", "9", ",", "\n", "#", "a", "[", "(m) "])
@pytest.mark.parametrize("place", ["alone", "header", "rows"])
def test_a_megabyte_of_equal_characters_is_read_or_refused_in_bounded_time(sign, place, tmp_path):
    """100 kB of blanks in a header took minutes, digits before a letter as long."""
    fill, start = sign * 10**6, time.process_time()
    texts = {"alone": fill, "header": f"t{fill}b,h\n0,1\n1,2\n", "rows": f"t,h\n0,1\n1,{fill}x\n"}
    try:
        columns(tmp_path / "rig.csv", texts[place])
    except ValueError as error:
        assert len(str(error)) < 1000
    assert time.process_time() - start < 5.0


def test_a_file_of_too_large_a_number_of_columns_is_refused(tmp_path):
    assert "has 10001 columns; expected at most 4096" in refusal(
        tmp_path / "rig.csv", "a," * 10**4 + "b\n" * 2
    )
