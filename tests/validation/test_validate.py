"""Validation: verdicts, data that lack or are cut short, gates without reason, tables from files, shipped cases."""

import hashlib
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from reference import folders

import fvsolve
from fvsolve.case.reading import read_raw
from fvsolve.cli import main
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies.validation import data_files, library
from fvsolve.studies.validation.row_texts import limits_of
from fvsolve.studies.validation.row_verdicts import DIFFERS, OUTSIDE, WITHIN

# measured data, if here
DATA = Path(os.environ.get("FVSOLVE_DATA") or Path(__file__).parents[3] / "shared" / "data")
# of the tank after 10 s: 0.02 m3/s sin(pi t / 10 s) over 2 m2, with a mean of 2 / pi
LEVEL = 1.0 + 0.2 / math.pi
SCENE = """
schema = 1
title = "A tank fills"
[fluid]
name = "Water"
temperature = "20 degC"
law = "linear"
[nodes.tank]
type = "tank"
area = "2 m2"
level = "1 m"
[nodes.source]
type = "inflow"
flow = "0.02*sin(pi*t/10)"
[links.way]
type = "orifice"
from = "source"
to = "tank"
diameter = "0.3 m"
[numerics]
end = "10 s"
rtol = 1e-8
[output]
every = "50 ms"
probes = ["tank.level"]
[validation]
source = "closed form"
"""


def scene(*rows: str, table: str = "", compare: str = "") -> str:
    """Case file of the scene with rows, further keys of `[validation]`, and series of `[compare]`."""
    text = (
        SCENE
        + table
        + "".join(
            f"\n[[validation.compare]]\nwhat = 'row {k}'\n{row}\n" for k, row in enumerate(rows)
        )
    )
    return text + (f"\n[compare]\n{compare}\n" if compare else "")


def validated(tmp_path: Path, text: str, data: Path | None = None) -> library.ValidationResult:
    path = tmp_path / "case.toml"
    path.write_text(text)
    return library.validate_file(path, data)


def exit_code(*words: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["fvsolve", "validate", *words])
        with pytest.raises(SystemExit) as ended:
            main()
    return ended.value.code or 0


def final(value: float, gate: str = "rtol = 1e-6", of: str = "exact", more: str = "") -> str:
    reference = "" if of == "others" else f"{of} = {{ value = {value} }}\n"
    return f'computed = "final(tank.level)"\n{reference}gate = {{ of = "{of}", {gate} }}\n{more}'


REASON = 'rtol = 1e-5, reason = "digits of the test"'


def test_a_right_value_is_within_and_a_planted_twelve_percent_is_outside(tmp_path, capsys):
    within = validated(tmp_path, scene(final(LEVEL, REASON)))
    assert within.verdict == WITHIN and within.rows[0].value == pytest.approx(LEVEL, rel=1e-6)
    assert exit_code(str(tmp_path / "case.toml")) == 0
    wrong = validated(tmp_path, scene(final(LEVEL, REASON), final(1.12 * LEVEL, REASON)))
    assert [row.verdict for row in wrong.rows] == [WITHIN, OUTSIDE] and wrong.verdict == OUTSIDE
    assert exit_code(str(tmp_path / "case.toml"), "--json") == 1
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert printed["exit_code"] == 1 and printed["validations"][0]["rows"][1]["verdict"] == OUTSIDE


def test_a_gate_wider_than_all_spreads_needs_a_reason(tmp_path):
    bare = validated(tmp_path, scene(final(LEVEL, "rtol = 0.2")))
    assert bare.verdict == OUTSIDE and "gate.reason" in bare.rows[0].text
    assert (
        validated(tmp_path, scene(final(LEVEL, 'rtol = 0.2, reason = "a test"'))).verdict == WITHIN
    )
    # codes spread as widely as the gate
    others = f'others = [{{ code = "a", value = {0.8 * LEVEL} }}]'
    assert validated(tmp_path, scene(final(LEVEL, "rtol = 0.19", more=others))).verdict == WITHIN


def test_a_far_measurement_widens_no_exact_gate_and_no_run_converges_to_itself(tmp_path):
    """The value is exact to 1e-8; the measurement is off by a half, the gate by a fifth."""
    measured = f"measured = {{ value = {1.5 * LEVEL} }}"
    found = validated(tmp_path, scene(final(LEVEL, "rtol = 0.2", more=measured)))
    assert found.verdict == OUTSIDE and "gate.reason" in found.rows[0].text
    same = 'computed = "final(tank.level)"\nexact = { resolution = 1 }\ngate = { of = "exact", rtol = 0.1 }'
    assert "expected a value above 1" in validated(tmp_path, scene(same)).fault


@pytest.mark.parametrize("because, verdict", [('because = "no waves"', DIFFERS), ("", OUTSIDE)])
def test_disagreement_with_the_measurement_in_agreement_with_codes_has_a_written_reason(
    tmp_path, because, verdict
):
    others = f'others = [{{ code = "a", value = {LEVEL} }}]\n{because}'
    measured = f"measured = {{ value = {1.2 * LEVEL} }}\n"
    row = final(LEVEL, "rtol = 0.01", "others", measured + others)
    found = validated(tmp_path, scene(row))
    assert found.verdict == verdict and "reason" in found.rows[0].text + "reason" * bool(because)
    assert library.exit_code([found]) == (verdict == OUTSIDE)
    # the measurement itself is the gate
    gated = final(1.2 * LEVEL, "rtol = 0.01", "measured", others)
    assert validated(tmp_path, scene(gated)).verdict == verdict


def test_an_interval_of_repeats_has_no_gap_inside(tmp_path):
    row = 'computed = "final(tank.level)"\nmeasured = {{ spread = [{}, {}] }}\ngate = {{ of = "measured" }}'
    assert validated(tmp_path, scene(row.format(LEVEL - 0.01, LEVEL + 0.02))).verdict == WITHIN
    assert validated(tmp_path, scene(row.format(LEVEL + 0.01, LEVEL + 0.02))).verdict == OUTSIDE


def level(t):
    return 1.0 + 0.1 / math.pi * (1.0 - np.cos(np.pi * t / 10.0))


def with_series(tmp_path: Path, shift: float, gate: str, rows: int = 100) -> tuple[str, Path]:
    """Case with a measured series whose clock is late by `shift` [s], and the folder of its data."""
    data = tmp_path / "data"
    data.mkdir(exist_ok=True)
    t = np.linspace(0.0, 10.0, rows)
    text = "t [s],level [m]\n" + "\n".join(
        f"{a:.6f},{b:.9f}" for a, b in zip(t, level(t - shift), strict=True)
    )
    (data / "tank.csv").write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    table = (
        f'files = {{ "tank.csv" = "sha256:{digest}, {len(text)} bytes" }}\nget = "from nowhere"\n'
    )
    row = f'computed = "mean_error(tank.level)"\nfrom = "3 s"\nto = "8 s"\ngate = {{ of = "measured", {gate} }}'
    return scene(row, table=table, compare='"tank.level" = { file = "tank.csv" }'), data


def test_a_moved_clock_is_reported_as_arrival(tmp_path):
    gate = 'atol = 1e-4, reason = "a test"'
    text, data = with_series(tmp_path, 0.0, gate)
    assert validated(tmp_path, text, data).verdict == WITHIN
    text, data = with_series(tmp_path, 0.7, gate)
    row = validated(tmp_path, text, data).rows[0]
    assert row.verdict == OUTSIDE and row.shift == pytest.approx(0.7, abs=0.05)
    assert "arrival: the computed series is 0.69" in row.text and "early" in row.text
    text, data = with_series(tmp_path, -0.7, gate)
    assert "late" in validated(tmp_path, text, data).rows[0].text


def test_data_that_lack_or_are_cut_short_are_named_and_never_pass(tmp_path, capsys):
    text, data = with_series(tmp_path, 0.0, 'atol = 1e-4, reason = "a test"')
    (tmp_path / "case.toml").write_text(text)
    assert exit_code(str(tmp_path / "case.toml")) == 3
    assert "tank.csv is missing" in (out := capsys.readouterr().out) and "from nowhere" in out
    whole = (data / "tank.csv").read_text()
    (data / "tank.csv").write_text(whole[:900])
    assert exit_code(str(tmp_path / "case.toml"), "--data", str(data)) == 3
    assert f"cut short: it has 900 of {len(whole)} bytes" in capsys.readouterr().out
    (data / "tank.csv").write_text(whole.replace("1.0", "1.1"))
    assert exit_code(str(tmp_path / "case.toml"), "--data", str(data)) == 3
    assert "another sum" in capsys.readouterr().out
    (data / "tank.csv").write_text(whole)
    assert exit_code(str(tmp_path / "case.toml"), "--data", str(data)) == 0


def test_all_faults_of_the_table_are_reported_at_once(tmp_path):
    rows = (
        'computed = "maks(tank.level)"\ngate = { of = "exact" }',
        'computed = "max(tank.level)"\nexact = { value = "1 kg" }\ngate = { of = "exakt" }',
        'computed = "max(tank.level)"\ngate = { of = "others" }',
        'computed = "mean_error(tank.level)"\ngate = { of = "exact" }',
    )
    (tmp_path / "case.toml").write_text(
        scene(*rows, table='files = { "a.csv" = "md5:1" }\nnonsense = 1\n')
    )
    with pytest.raises(CaseError) as caught:
        library.load(tmp_path / "case.toml")
    message = str(caught.value)
    for part in (
        "maks",
        '"1 kg"',
        "exakt",
        "others = [",
        "no measured series",
        "md5",
        "nonsense",
    ):
        assert part in message, part


PROFILE = 'profile = {{ solution = "{}", {} = 1 }}\n'


@pytest.mark.parametrize("table, row, told", [
    ('files = { "../a.csv" = "sha256:' + 64 * "0" + '" }\n', final(LEVEL), "leads out of its folder"),
    ('tables."/tmp/a.csv" = { of = "a", columns = { "t" = "c1" } }\n', final(LEVEL), "leads out of its folder"),
    (PROFILE.format("bumb", "flow"), final(LEVEL), 'did you mean "bump"'),
    (PROFILE.format("bump", "flows"), final(LEVEL), 'did you mean "flow"'),
    ("", 'computed = "profile_error(tank.depth)"\ngate = { of = "exact", atol = 1 }', "is not a basin"),
    ("", 'computed = "profile_error(tank.mass)"\ngate = { of = "exact", atol = 1 }', "no exact profile"),
    ('tables."a.csv" = { of = "b.csv", columns = { "t" = "c1" } }\n', final(LEVEL), "b.csv cannot be read"),
    ('network = { inp = "a.inp", hour = "noon" }\n', final(LEVEL), "noon"),
])  # fmt: skip
def test_faults_of_files_profiles_and_networks_are_messages(tmp_path, table, row, told):
    try:
        message = validated(tmp_path, scene(row, table=table)).fault
    except CaseError as error:
        message = str(error)
    assert told in message, message


def test_two_files_of_equal_names_are_refused_and_a_stored_case_runs(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "case.toml").write_text(scene(final(LEVEL, REASON)))
    with pytest.raises(FvsolveError, match="have the same name"):
        library.find([str(tmp_path / folder / "case.toml") for folder in ("a", "b")])
    library.validate_file(tmp_path / "a" / "case.toml", out=tmp_path / "kept")
    assert fvsolve.run(tmp_path / "kept" / "case" / "case.toml").ok


def test_a_value_that_is_never_reached_is_outside_and_prints(tmp_path, capsys):
    row = 'computed = "time(tank.level, 9 m)"\nmeasured = { value = 1 }\ngate = { of = "measured" }'
    (tmp_path / "case.toml").write_text(scene(row))
    assert exit_code(str(tmp_path / "case.toml"), "--json") == 1
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])["validations"][0]["rows"][0]
    assert printed["value"] is None and "does not exist" in printed["reason"]


def test_a_scene_that_another_row_changes_runs_again(tmp_path):
    half = final(
        1.0 + 0.1 / math.pi, REASON, more='set = { "nodes.source.flow" = "0.01*sin(pi*t/10)" }'
    )
    found = validated(tmp_path, scene(final(LEVEL, REASON), half))
    assert [row.verdict for row in found.rows] == [WITHIN, WITHIN]


def test_tables_are_formed_by_formulas_integrals_and_from_matrices(tmp_path):
    (tmp_path / "a.txt").write_text("a title\n1  10 NaN\n2\t20,30\n3 ; 30 ; 60\n-1 5 5\n")
    made = data_files.derived_table(
        tmp_path / "a.txt", 1, {"t [s]": "c1 - 1", "x": "2*c2"}, False, 1, "c1 > 0"
    )
    assert list(made) == ["t [s]", "x"] and made["x"].tolist() == [20.0, 40.0, 60.0]
    made = data_files.derived_table(
        tmp_path / "a.txt", 1, {"t [s]": "c1", "x": "integral(c2)"}, False, 1, "c1 > 0"
    )
    assert made["x"].tolist() == [0.0, 15.0, 40.0]
    with_third = data_files.derived_table(
        tmp_path / "a.txt", 1, {"t [s]": "c1", "z": "c3"}, False, 1, ""
    )
    # in order of time, without the row that has no number
    assert with_third["t [s]"].tolist() == [-1.0, 2.0, 3.0]
    (tmp_path / "m.txt").write_text("1 2 3\n4 5 6\n7 8 9\n")
    made = data_files.derived_table(
        tmp_path / "m.txt", 0, {"x": "c1", "y": "c2", "z": "c3"}, True, 2, ""
    )
    assert np.column_stack(list(made.values())).tolist() == [
        [0, 0, 1],
        [0, 2, 3],
        [2, 0, 7],
        [2, 2, 9],
    ]
    with pytest.raises(FvsolveError, match="c9 is unknown"):
        data_files.derived_table(tmp_path / "a.txt", 1, {"t": "c9"}, False, 1, "")


SHIPPED = library.paths()


def test_the_library_covers_the_field():
    waves = {"solitary-wave", "island-a", "monai", "stoker", "ritter", "thacker", "triangular-sill"}
    networks = {
        "adelaide-severe",
        "tnet3-valve",
        "epanet-networks",
        "laminar-line-exact",
        "heated-pipe",
    }
    assert waves | networks | {"stiff-problems"} <= {*SHIPPED}


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_validations_state_source_licence_and_how_to_get_files(name):
    table = library.read_table(read_raw(SHIPPED[name]))
    assert table.source and table.licence and (table.get or not table.files)


@pytest.mark.parametrize("name", SHIPPED)
def test_files_of_shipped_validations_have_their_sums(name):
    table = library.read_table(read_raw(SHIPPED[name]))
    if table.files and not DATA.is_dir():
        pytest.skip(f"no measured data here: {DATA}")
    assert data_files.missing_files(table, DATA) == []


@pytest.mark.parametrize(
    "name", ["stoker", "ritter", "single-pipe", "laminar-line-exact", "adelaide-moderate"]
)
def test_shipped_validations_without_files_are_within(name):
    assert library.validate_file(SHIPPED[name]).verdict == WITHIN


@pytest.mark.parametrize(
    "name, verdict", [("heated-pipe", WITHIN), ("tnet3-valve", WITHIN), ("adelaide-severe", WITHIN)]
)
def test_shipped_validations_with_measured_files(name, verdict):
    if not DATA.is_dir():
        pytest.skip(f"no measured data here: {DATA}")
    assert library.validate_file(SHIPPED[name], DATA).verdict == verdict


def test_the_page_has_a_figure_of_each_case_in_both_themes(tmp_path):
    assert exit_code("stoker", "--page", str(tmp_path / "page")) == 0
    page = (tmp_path / "page" / "index.md").read_text()
    for theme in ("light", "dark"):
        assert (
            f"(stoker-{theme}.png)" in page
            and (tmp_path / "page" / f"stoker-{theme}.png").stat().st_size > 5000
        )
    assert (
        "Stoker 1957" in page
        and "within" in page
        and "| depth, mean error over mean depth |" in page
    )
    assert "| - | 0 to 0.004 | - | within |" in page  # the gate of the case: at most 0.004


def test_limits_contain_the_measured_value_and_the_margin():
    row = library.validate_file(SHIPPED["adelaide-moderate"]).rows[0]
    low, high = limits_of(row)
    assert (
        low < row.in_unit(row.row.measured["value"]) < high and low < row.in_unit(row.value) < high
    )
    assert low + high == pytest.approx(2.0 * row.in_unit(row.row.measured["value"]), rel=1e-12)


def test_long_cases_begin_first():
    grids = {"few": [10, 10], "many": [20, 20], "finer": [10, 10]}
    tables = {name: {"nodes": {"pool": {"cells": cells}}} for name, cells in grids.items()}
    tables["finer"]["validation"] = {"compare": [{"exact": {"resolution": 4}}]}
    assert sorted(tables, key=lambda name: -library.cell_steps(tables[name])) == [
        "finer",
        "many",
        "few",
    ]
    assert library.cell_steps({"nodes": {"main": {"cells": 100}}}) == 0.0


def test_an_unknown_name_is_named_with_the_nearest():
    with pytest.raises(FvsolveError, match='did you mean "stoker"'):
        library.find(["stokes"])
    assert folders.CASES.joinpath("validation").is_dir()
