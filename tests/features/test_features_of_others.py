"""Features of other packages: the package of docs/extending.md, as printed, and headers that are refused."""

import ast
import inspect
import re
import shutil
import tomllib

import pytest
from reference.folders import section
from reference.outside_packages import install, python

import fvsolve
from fvsolve.compile import cache_folders
from fvsolve.core.assembly import features

TEXT = section("extending", "A feature in one folder")
FILES = dict(re.findall(r"`([\w./]+\.\w+)`:\n\n```\w+\n(.*?)```", TEXT, re.DOTALL))
((COMMAND, OUTPUT),) = re.findall(r"```sh\n(.*?)\n```\n\n```text\n(.*?)\n```", TEXT, re.DOTALL)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Folder with the installed package of the page."""
    project = tomllib.loads(FILES["pyproject.toml"])["project"]
    files = {name: text for name, text in FILES.items() if name.startswith(project["name"])}
    return install(tmp_path_factory.mktemp("home"), project["name"], files, project["entry-points"])


def test_the_feature_of_the_page_runs_and_no_file_of_the_package_changes(home):
    """The counts of a feature with its own table, arrays and notice, beside those of the core."""
    assert OUTPUT in python(home, "-m", *COMMAND.split()).stdout.splitlines()


def test_a_feature_of_another_package_works_with_delay_lines_and_in_a_resumed_run(home):
    """A run in two parts has the counts of a run without a pause, but for records of the state in between."""
    text = """
import fvsolve
case = fvsolve.load("streeter-nine-pipes", {"numerics.pipe_model": "auto", "links.R1-N3.pipe_model": "finite-volume"})
model = fvsolve.build(case)
start, end = fvsolve.initial_state(model), case.numerics.end
whole, half = fvsolve.advance(model, start, end), fvsolve.advance(model, start, 0.5 * end)
both = fvsolve.advance(model, half, end)
print(*(type(feature).__name__ for feature in model.features), *sorted(both.memory))
print(half.memory["counter"][0] > 10.0, abs(both.memory["counter"][0] - whole.memory["counter"][0]) <= 2.0)
highest = [state.memory["highest"] for state in (half, both, whole)]
print((highest[0] <= highest[1]).all(), abs(highest[1] - highest[2]).max() < 1e-3 * highest[2].max())
"""
    names, counts, highest = python(home, "-c", text).stdout.splitlines()
    assert names.startswith("DelayLines Counter ") and " counter" in names and " past" in names
    assert counts == "True True" and highest == "True True"


def test_built_in_features_have_slots_of_their_own():
    headers = list(features.headers())
    assert (
        len({header.slot for header in headers})
        == len(headers)
        == len(features.FEATURES.own())
        == 6
    )
    assert all(header.declaration.load().slot == header.slot for header in headers)
    assert all(header.declaration.load().wakes == header.wakes for header in headers)


def test_a_feature_that_cannot_be_imported_is_named_and_left_out(tmp_path):
    """Every case asks the class of an entry point for its words; a fault there must not end the run."""
    home = install(
        tmp_path,
        "broken",
        {"broken.py": "import no_such_module\n"},
        {"fvsolve.features": {"lost": "broken:Lost"}},
    )
    done = python(home, "-m", "fvsolve", "check", "two-tanks")
    assert "lost of the entry points fvsolve.features of broken" in done.stderr
    assert (
        "broken:Lost cannot be read: No module named 'no_such_module'; correct or remove it"
        in done.stderr
    )


SAME_SLOT = """
from fvsolve.core.assembly.features import Feature

class Twin(Feature, slot=0, wakes="pipe_model auto"):
    pass
"""


def test_two_features_with_the_same_slot_are_refused(tmp_path, monkeypatch):
    (tmp_path / "twin.py").write_text(SAME_SLOT, encoding="utf-8")
    monkeypatch.setenv("FVSOLVE_FEATURES", str(tmp_path / "twin.py"))
    fvsolve.build(fvsolve.load("valve-closure"))  # it wakes neither
    with pytest.raises(
        fvsolve.FvsolveError,
        match="DelayLines and Twin both have the slot 0; expected another slot",
    ):
        fvsolve.build(fvsolve.load("valve-closure", {"numerics.pipe_model": "auto"}))


@pytest.mark.parametrize("name", ["delay_lines", "controls"])
def test_an_edit_of_a_compiled_file_of_a_feature_compiles_that_feature_alone(name, tmp_path):
    """The hash of the core contains no file of a feature; that of a feature its compiled files and no others."""
    core = cache_folders.compiled_sources()
    folder = cache_folders.PACKAGE / "features" / name
    assert core and not [path for path in core if folder in path.parents]
    copy = tmp_path / name
    shutil.copytree(folder, copy)
    patterns = re.findall(r'"([^"]+\.py)"', (copy / "__init__.py").read_text("utf-8"))
    assert patterns
    before = digest(copy, patterns)
    (copy / "feature.py").write_text("# changed\n", encoding="utf-8")
    assert digest(copy, patterns) == before
    edited = next((copy / "kernels").glob("[a-z]*.py"))
    edited.write_text(edited.read_text("utf-8") + "# changed\n", encoding="utf-8")
    assert digest(copy, patterns) != before


def digest(folder, patterns) -> str:
    """Name of the folder for machine code of a copy of a feature."""
    cache_folders.add_sources(folder, *patterns)
    return cache_folders.EXTRA_FOLDERS.pop(folder.resolve())


@pytest.mark.parametrize("name", [*features.FEATURES])
def test_no_attribute_of_a_feature_hides_a_method_of_the_protocol(name):
    """The core calls some methods only in rare studies, which would find a value in their place."""
    module = inspect.getmodule(features.FEATURES.load(name))
    classes = features.Feature, features.FeatureRun, features.FeaturePattern
    methods = {
        key for one in classes for key, value in vars(one).items() if inspect.isfunction(value)
    }
    nodes = [
        node
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        if isinstance(node, ast.Attribute)
    ]
    assigned = {node.attr for node in nodes if isinstance(node.ctx, ast.Store)}
    assert "driven" in methods and not assigned & methods
