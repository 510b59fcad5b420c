"""Declarations in the package, in installed packages and in files of a user are found without imports."""

import ast
import inspect
import os
import subprocess
import sys
import warnings
import zipfile

import pytest
from reference.outside_packages import install, python

from fvsolve import declarations
from fvsolve.declarations import Declarations
from fvsolve.errors import FvsolveError

VALVES = '''"""Gadgets."""
raise_at_import = 1 / {divisor}

@declared("gadget", "slow-valve", size=3)
def slow_valve():
    return "slow"


@declared("gadget")
class Valve:
    class Seat:
        pass


@declared("other")
def no_gadget():
    pass
'''
GROUP = "fvsolve.gadgets"


@pytest.fixture
def index(tmp_path, monkeypatch) -> Declarations:
    """Index of the noun "gadget", whose package is a folder `fvsolve` of the test."""
    package = tmp_path / "gadget_maker"
    package.mkdir()
    head = "from fvsolve.declarations import declared\n"
    (package / "own.py").write_text(head + VALVES.format(divisor=1), encoding="utf-8")
    (package / "broken.py").write_text(
        '1 / 0\n@declared("gadget")\ndef pump():\n    pass\n', encoding="utf-8"
    )
    (package / "unused.txt").write_text(
        '\n@declared("gadget")\ndef text():\n    pass\n', encoding="utf-8"
    )
    monkeypatch.setattr(declarations, "PACKAGE", package)
    monkeypatch.syspath_prepend(tmp_path)
    yield Declarations("gadget", "gadgets", ("*.py",))
    for name in [name for name in sys.modules if name.startswith("gadget_")]:
        del sys.modules[name]


def offered(tmp_path, monkeypatch, name: str, entries: dict[str, str], **files: str) -> None:
    """Install a package with modules and entry points."""
    home = tmp_path / f"site-{name}"
    install(
        home,
        name,
        {f"{name}/{module}.py": text for module, text in files.items()},
        {GROUP: entries},
    )
    monkeypatch.syspath_prepend(home)


def test_headers_are_read_and_modules_are_imported_at_first_use(index):
    assert list(index) == ["pump", "slow-valve", "Valve"] and len(index) == 3
    assert "gadget_maker.own" not in sys.modules
    assert index.load("slow-valve")() == "slow" and index.load("Valve").__name__ == "Valve"


def test_the_package_is_read_up_to_the_name_in_question(index):
    assert index["pump"].module == "gadget_maker.broken"
    assert [*index._own] == ["pump"]


def test_an_unknown_name_has_a_hint(index):
    with pytest.raises(
        FvsolveError, match='unknown gadget "slow-valv"; did you mean "slow-valve"?'
    ):
        index.load("slow-valv")
    with pytest.raises(
        FvsolveError, match='unknown gadget "q"; expected one of Valve, pump, slow-valve'
    ):
        index.load("q")


def test_a_fault_of_the_package_itself_is_raised_as_it_is(index):
    with pytest.raises(ZeroDivisionError):
        index.load("pump")


def test_entry_points_follow_those_of_the_package(index, tmp_path, monkeypatch):
    offered(
        tmp_path,
        monkeypatch,
        "gadget_mill",
        {"wheel": "gadget_mill.parts:Wheel.hub"},
        __init__="",
        parts="class Wheel:\n    hub = 7\n",
    )
    assert list(index) == ["pump", "slow-valve", "Valve", "wheel"]
    assert "class Wheel" in index["wheel"].text() and "gadget_mill" not in sys.modules
    assert index.load("wheel") == 7


def test_a_module_that_fails_names_its_source_and_breaks_no_other(index, tmp_path, monkeypatch):
    entries = {
        "wheel": "gadget_mill:wheel",
        "lost": "gadget_mill.lost:x",
        "exits": "gadget_mill.exits:x",
    }
    offered(
        tmp_path,
        monkeypatch,
        "gadget_mill",
        entries,
        __init__="wheel = 7\n",
        exits="import sys; sys.exit(3)\n",
    )
    assert index.load("wheel") == 7
    source = "lost of the entry points fvsolve.gadgets of gadget_mill: gadget_mill.lost:x cannot be read: "
    with pytest.raises(
        FvsolveError, match=f"{source}No module named 'gadget_mill.lost'; correct or remove it"
    ):
        index.load("lost")
    with pytest.raises(
        FvsolveError, match="gadget_mill.exits:x cannot be read: 3; correct or remove it"
    ):
        index.load("exits")


def test_a_name_that_exists_twice_causes_a_warning_and_stays_that_of_the_first(
    index, tmp_path, monkeypatch
):
    offered(
        tmp_path, monkeypatch, "gadget_b", {"wheel": "gadget_b:second"}, __init__="second = 2\n"
    )
    offered(
        tmp_path,
        monkeypatch,
        "gadget_a",
        {"wheel": "gadget_a:first", "Valve": "gadget_a:first"},
        __init__="first = 1\n",
    )
    with pytest.warns(RuntimeWarning) as caught:
        assert index.load("wheel") == 1
    assert sorted(str(one.message) for one in caught) == [
        f"{name} of the entry points fvsolve.gadgets of {package}: {place} cannot be read: a declaration of the gadget "
        f'"{name}" exists already; expected another name; correct or remove it'
        for name, package, place in (
            ("Valve", "gadget_a", "gadget_a:first"),
            ("wheel", "gadget_b", "gadget_b:second"),
        )
    ]
    assert index.load("Valve").__name__ == "Valve"
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning is given once
        assert len(index) == 4


def test_others_are_read_only_for_a_name_that_the_package_lacks(index, tmp_path, monkeypatch):
    offered(tmp_path, monkeypatch, "gadget_bad", {"wheel": "gadget_bad"}, __init__="")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert index.load("slow-valve")() == "slow"
    with pytest.warns(
        RuntimeWarning,
        match="gadget_bad cannot be read: it names no object; expected MODULE:OBJECT",
    ):
        assert "wheel" not in index


def test_files_and_folders_of_a_user_are_read_by_their_headers(index, tmp_path, monkeypatch):
    text = 'from fvsolve.declarations import declared\n@declared("gadget", "{0}")\ndef f():\n    return "{0}"\n'
    (tmp_path / "mine").mkdir()
    for place, name in (("mine/a.py", "tap"), ("mine/b.py", "cock"), ("alone.py", "plug")):
        (tmp_path / place).write_text(text.format(name), encoding="utf-8")
    places = [str(tmp_path / name) for name in ("mine", "alone.py", "absent.py")]
    monkeypatch.setenv("FVSOLVE_GADGETS", os.pathsep.join(places))
    with pytest.warns(
        RuntimeWarning,
        match="FVSOLVE_GADGETS: .*absent.py cannot be read: .*; correct or remove it",
    ):
        assert [index.load(name)() for name in ("tap", "cock", "plug")] == ["tap", "cock", "plug"]
    (tmp_path / "alone.py").write_text("1 / 0\n" + text.format("plug"), encoding="utf-8")
    declarations._module_of_file.cache_clear()
    with pytest.raises(
        FvsolveError,
        match="FVSOLVE_GADGETS: .*alone.py:f cannot be read: division by zero; correct",
    ):
        index.load("plug")


def test_packages_in_zip_files_are_located_and_a_second_copy_of_a_package_is_not(
    index, tmp_path, monkeypatch
):
    offered(tmp_path, monkeypatch, "gadget_old", {"old": "gadget_old:x"}, __init__="x = 1\n")
    home = install(
        tmp_path / "newer",
        "gadget_old",
        {"gadget_old/__init__.py": "x = 2\n"},
        {GROUP: {"new": "gadget_old:x"}},
    )
    monkeypatch.syspath_prepend(home)
    zipped = install(
        tmp_path / "zipped",
        "gadget_zip",
        {"gadget_zip/__init__.py": "x = 3\n"},
        {GROUP: {"zipped": "gadget_zip:x"}},
    )
    with zipfile.ZipFile(tmp_path / "packages.zip", "w") as archive:
        for path in zipped.rglob("*"):
            archive.write(path, path.relative_to(zipped))
    monkeypatch.syspath_prepend(tmp_path / "packages.zip")
    assert list(index.others()) == ["zipped", "new"]
    assert index.load("zipped") == 3 and index.load("new") == 2


def test_unreadable_parts_and_limiters_cause_warnings_and_break_nothing(tmp_path):
    entries = {
        "fvsolve.parts": {"mill": "mill.lost"},
        "fvsolve.limiters": {"steep": "mill:steep", "flat": "mill:flat"},
    }
    text = "def steep(r):\n    return 1 / 0\n\ndef flat(r):\n    return 0.0\n"
    home = install(tmp_path, "mill", {"mill/__init__.py": text}, entries)
    code = (
        "import fvsolve.parts, fvsolve.core.schemes; print('flat' in fvsolve.core.schemes.LIMITERS)"
    )
    done = python(home, "-c", code, FVSOLVE_PARTS=str(tmp_path / "absent"))
    assert done.stdout == "True\n"
    for text in (
        "mill of the entry points fvsolve.parts of mill: mill.lost cannot be read: No module named 'mill.lost'; ",
        f"FVSOLVE_PARTS: {tmp_path / 'absent'} cannot be read: register_part: ",
        "entry points fvsolve.limiters of mill: steep = mill:steep cannot be read: register_limiter: steep(-1e+15)",
    ):
        assert done.stderr.count(text) == 1


def test_all_groups_of_entry_points_are_known_before_their_indices_are_imported():
    import fvsolve.case.sections as sections
    from fvsolve import cli, exact, studies
    from fvsolve.case.declared_tables import DECLARED
    from fvsolve.core.assembly.features import FEATURES
    from fvsolve.parts import plugins

    indices = cli.COMMANDS, DECLARED, exact.NAMES, FEATURES, sections.SINKS, studies.STUDIES
    groups = {index.group: index.noun for index in indices}
    groups |= {plugins.GROUP: "part", plugins.LIMITERS: "limiter"}
    known = ast.parse(inspect.getsource(declarations)).body
    (known,) = [line for line in known if ast.unparse(line).startswith("GROUPS = ")]
    assert ast.literal_eval(known.value) == groups


HEADERS = {
    "features": 'class Cranes(Feature, slot=9, wakes="kind crane, kind winch"):',
    "laws": 'class Gas(SampledLaw, name="gas"):',
    "kinds": 'class Crane(Link, kind="crane"):',
    "commands": '@command("lift", order=9)\ndef lift(case: str) -> None:',
    "studies": '@declared("study", "lifts")\ndef lifts(case):',
}


@pytest.mark.parametrize("width", [88, 20])
def test_a_header_may_be_broken_into_lines_by_a_formatter(width):
    from fvsolve.cli import COMMANDS
    from fvsolve.core.assembly.features import FEATURES
    from fvsolve.core.fluid import LAWS
    from fvsolve.parts.kinds import DECLARATION
    from fvsolve.studies import STUDIES

    patterns = {
        "features": FEATURES.header,
        "laws": LAWS.header,
        "kinds": DECLARATION,
        "commands": COMMANDS.header,
        "studies": STUDIES.header,
    }
    for name, header in HEADERS.items():
        text = header + ("\n    pass\n" if header.startswith("class") else '\n    """Lift."""\n')
        command = [sys.executable, "-m", "ruff", "format", f"--line-length={width}", "-"]
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
        assert ("\n    " in done.stdout.partition(":\n")[0]) == (width == 20)
        whole, broken = (patterns[name].search(f"\n{text}") for text in (text, done.stdout))
        assert whole and broken and broken.groupdict() == whole.groupdict(), name
