"""Studies of fvsolve and of other packages are found by their declarations, as attributes of fvsolve.studies."""

import subprocess
import sys
import warnings

import pytest
from reference.outside_packages import install

from fvsolve import studies
from fvsolve.declarations import headers
from fvsolve.errors import FvsolveError

STUDY = '''
def draining(case):
    """Study of another package."""
    return f"drained {case}"
'''
PLACES = {"draining": "drains:draining", "order": "drains:draining", "lost": "drains.lost:x"}


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(
        install(tmp_path, "drains", {"drains/__init__.py": STUDY}, {"fvsolve.studies": PLACES})
    )
    yield tmp_path
    sys.modules.pop("drains", None)
    vars(studies).pop("draining", None)


@pytest.mark.filterwarnings("ignore:order of the entry points")
def test_a_study_of_another_package_is_an_attribute(home):
    assert studies.draining("two-tanks") == "drained two-tanks"
    assert "draining" in studies.__all__ and "draining" in dir(studies)


@pytest.mark.filterwarnings("ignore:order of the entry points")
def test_a_study_that_cannot_be_imported_names_its_package_and_breaks_no_other(home):
    with pytest.raises(
        FvsolveError,
        match="lost of the entry points fvsolve.studies of drains: drains.lost:x cannot",
    ):
        studies.lost  # noqa: B018
    assert studies.draining("a") == "drained a"
    with pytest.raises(AttributeError, match="module 'fvsolve.studies' has no attribute 'drainin'"):
        studies.drainin  # noqa: B018


def test_a_study_of_fvsolve_retains_its_name(home):
    vars(studies).pop("order", None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # no other package is read
        assert studies.order.__module__ == "fvsolve.studies.accuracy.order"
    with pytest.warns(
        RuntimeWarning, match='drains:draining cannot be read: .* study "order" exists'
    ):
        assert studies.__all__.count("order") == 1


def test_each_header_of_the_package_is_a_public_name_of_its_module():
    found = {
        match["attribute"]: module for module, match in headers(PATTERNS, studies.STUDIES.header)
    }
    assert found.keys() == studies.STUDIES.own().keys() and {
        "sweep",
        "order",
        "Linear",
        "advection_limit",
    } <= {*found}
    assert [
        name for name, module in found.items() if getattr(studies, name).__module__ != module
    ] == []
    count = sum(1 for _ in headers(PATTERNS, studies.STUDIES.header))
    assert count == len(found) == 32


PATTERNS = ("studies/**/*.py", "core/step_limits/*.py")


def test_a_study_is_imported_alone():
    code = "import sys, fvsolve.studies; fvsolve.studies.fit; print(*sys.modules)"
    modules = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert "fvsolve.studies.accuracy.fit" in modules and "fvsolve.studies.sweep" not in modules
