"""`fvsolve new --template`: each template is written, read without notices, runs, and its limits hold."""

import math
import tomllib
from pathlib import Path

import pytest

import fvsolve
from fvsolve.case import shipped
from fvsolve.report.tables import parts

NAMES = ("course", "network", "pumping-main", "servo", "street-and-sewer", "tank-and-wave")
# ends of shorter runs; the limits are those of the whole template
SHORT = {"street-and-sewer": "8 min", "tank-and-wave": "40 s", "pumping-main": "60 s"}


@pytest.fixture
def folder(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_help_names_every_template_and_an_unknown_template_is_refused(fvs, folder):
    assert tuple(shipped.templates()) == NAMES
    words = fvs("new", "--help")[1].replace("\n", " ").split()
    assert {*NAMES} <= {word.strip(",.") for word in words}
    code, _, err = fvs("new", "--template", "pumpingmain")
    assert code == 2 and 'did you mean "pumping-main"' in err
    code, _, err = fvs("new")
    assert code == 2 and "NAME is missing" in err and "--template" in err


@pytest.mark.parametrize("name", NAMES)
def test_a_template_is_written_and_runs_without_notices_within_its_limits(name, fvs, folder):
    code, out, _ = fvs("new", "--template", name)
    assert code == 0 and out.splitlines()[0] == f"{name}.toml" and Path("schema.json").is_file()
    case = fvsolve.load(folder / f"{name}.toml")
    assert case.title and case.description
    result = fvsolve.run(case, out=folder / "run", pictures=False, set=ends_of(name))
    summary = result.summary
    notices = [one["text"] for one in summary["warnings"] if "continues" not in one["text"]]
    assert summary["ok"] and notices == []
    assert summary["verdicts"] and all(verdict["margin"] > 0.0 for verdict in summary["verdicts"])


def test_a_conduit_has_a_single_row_in_the_report(folder):
    case = fvsolve.load(shipped.folder() / "templates" / "street-and-sewer.toml")
    result = fvsolve.run(case, out=folder / "run", pictures=False, set={"numerics.end": 1.0})
    rows = parts(result).rows
    assert [row[1] for row in rows if row[0] in ("sewer", "upper_sewer")] == ["conduit", "conduit"]
    assert not any("Conduit(" in str(cell) for row in rows for cell in row)


def ends_of(name):
    return {"numerics.end": SHORT[name]} if name in SHORT else {}


@pytest.mark.parametrize("name", NAMES)
def test_each_value_for_a_change_has_a_mark_with_a_reason(name):
    text = (shipped.folder() / "templates" / f"{name}.toml").read_text(encoding="utf-8")
    assert text.startswith("#:schema schema.json\n")
    assert text.count("#") > 12 and (name == "course" or text.count("# >>>") >= 8)
    assert {"fluid", "limits", "numerics", "output"} <= tomllib.loads(text).keys()


def test_the_study_of_a_template_names_the_written_file(fvs, folder):
    code, out, _ = fvs("new", "--template", "pumping-main", "my main.toml")
    assert code == 0 and out.splitlines()[:2] == ["my main.toml", "my main-study.toml"]
    study = tomllib.loads(Path("my main-study.toml").read_text(encoding="utf-8"))
    assert study["case"] == "my main.toml"
    assert len(study["events"]) == 3 and len(study["protections"]) == 4
    code, _, err = fvs("new", "--template", "pumping-main", "my main.toml")
    assert code == 2 and "my main.toml exists" in err
    code, _, err = fvs("new", "two-tanks", "file.toml", "--template", "servo")
    assert code == 2 and "a template has no NAME" in err


def test_the_study_of_the_pumping_main_separates_protections(fvs, folder):
    """Without protection the column separates after a trip; the vessel and the flywheel prevent it."""
    fvs("new", "--template", "pumping-main")
    text = Path("pumping-main-study.toml").read_text(encoding="utf-8")
    study = tomllib.loads(text)
    short = {"numerics.end": "30 s", "links.main.cells": 40}
    case = fvsolve.load("pumping-main.toml", short)
    vacuum = {}
    for name, keys in study["protections"].items():
        table = {".".join(path): value for path, value in leaves(keys)}
        result = fvsolve.run(fvsolve.load(case, table), out=folder / name, pictures=False)
        verdicts = {verdict["name"]: verdict for verdict in result.summary["verdicts"]}
        vacuum[name] = verdicts["vacuum"]["margin"]
    assert vacuum["none"] < 0.0 < min(vacuum["vessel"], vacuum["large-vessel"], vacuum["flywheel"])


def leaves(table, path=()):
    """Yield key path and value of each value that is not a table."""
    for key, value in table.items():
        keys = (*path, *key.split("."))
        if isinstance(value, dict):
            yield from leaves(value, keys)
        else:
            yield keys, value


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("heun", 3), ("rk4", 4)])
def test_the_course_has_the_order_of_a_method_against_the_parabola(method, order, fvs, folder):
    """The difference of the levels is (sqrt(3) - k t)^2; halved steps divide the error by 2^order."""
    rate = 0.61 * 50e-4 * math.sqrt(9.80665 / 2) * (1 / 3 + 1 / 1.5)
    exact = 3.0 - (math.sqrt(3.0) - rate * 120.0) ** 2  # fall of the difference
    errors = []
    for step in (24.0, 12.0):
        settings = {"numerics.method": method, "numerics.step": step, "numerics.end": 120.0}
        settings |= {"expect": {}, "output.every": 120.0}
        case = fvsolve.load(shipped.folder() / "templates" / "course.toml", settings)
        levels = fvsolve.run(case, out=folder / f"{step}", pictures=False)
        difference = levels["high.level"][-1] - levels["low.level"][-1]
        errors.append(abs(3.0 - difference - exact))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)
