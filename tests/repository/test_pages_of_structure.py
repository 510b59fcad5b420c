"""Pages about the structure: the nine verbs of a part, the way of a run, the folders of the package."""

import re
from pathlib import Path

from reference.folders import DOCS, section

import fvsolve
from fvsolve.core.assembly.lowering import Device, Lowering, Restriction

PACKAGE = Path(fvsolve.__file__).parent
VERB = re.compile(r"^\| (\w+) \| .+ \| (.+) \|$", re.MULTILINE)
REGISTRY = {"kinds"}  # of the classes themselves, which no part overrides
STATION = re.compile(r"^ *(\S+\.py) +(?:([A-Za-z_]+)(?:\.(\w+))?[:,] )?", re.MULTILINE)


def test_nine_verbs_order_all_methods_of_a_part():
    rows = {
        verb: re.findall(r"`(\w+)`", names)
        for verb, names in VERB.findall(section("own-parts", "Nine verbs of a part"))
    }
    for head in ("verb", "function"):
        rows.pop(head, None)
    named = [name for names in rows.values() for name in names]
    declared = {
        name
        for one in (Lowering, Restriction, Device)
        for name in {*vars(one), *one.__annotations__}
    }
    assert len(rows) == 9 and len(named) == len(set(named))
    assert set(named) == {name for name in declared if not name.startswith("_")} - REGISTRY


def test_stations_on_the_way_of_a_run_exist():
    page = (DOCS / "developing.md").read_text("utf-8")
    way = page.partition("## How a run goes")[2].partition("```text\n")[2].partition("```")[0]
    stations = STATION.findall(way)
    assert len(stations) == way.count(".py") > 10
    for path, name, method in stations:
        source = (PACKAGE / path).read_text("utf-8")
        if name not in ("", "conductance", "probes"):  # a value or a word
            assert re.search(rf"^(?:class|def) {name}\b", source, re.MULTILINE), f"{path}: {name}"
        assert not method or re.search(rf"^    def {method}\b", source, re.MULTILINE), (
            f"{path}: {method}"
        )


def test_docstrings_of_folders_state_contents_and_imports():
    page = (DOCS / "developing.md").read_text("utf-8").partition("## How a run goes")[0]
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")} - {"data"}
    named = {
        name
        for names in re.findall(r"^\| (`.+?`) \|", page, re.MULTILINE)
        for name in re.findall(r"`(\w+)`", names)
    }
    inside = {path.stem for path in (PACKAGE / "core").iterdir() if not path.name.startswith("_")}
    assert len(folders) == 10 and named == folders | inside
    for name in folders:
        first = (PACKAGE / name / "__init__.py").read_text("utf-8").partition("\n")[0]
        assert re.search(r"may import|imports only", first), f"{name}: {first}"
