"""Exact solutions of other packages: a case names them, and their faults break no other case."""

import sys
import warnings

import numpy as np
import pytest
from reference.folders import CASES
from reference.outside_packages import install

import fvsolve
from fvsolve import exact
from fvsolve.declarations import headers
from fvsolve.errors import CaseError, FvsolveError

SOLUTIONS = """
from fvsolve.exact import Exact, Solution


def find_faults(case):
    if not case.links["push"].force.constant:
        yield ("links", "push", "force"), "needs a constant force"


def solution(case, start):
    return Solution(case, velocity={"cart": lambda t: 2.0 * t})


FREE_MASS = Exact("free-mass", ("mass",), ("force",), find_faults, solution)
"""
CART = {
    "fluid": {"name": "water", "temperature": 288.15},
    "nodes": {"cart": {"type": "mass", "mass": 40.0}},
    "links": {"push": {"type": "force", "to": "cart", "force": 80.0}},
    "numerics": {"end": 1.0, "method": "rk4", "step": 0.1},
    "output": {"probes": ["cart.velocity"]},
}
GROUP = "fvsolve.exact_solutions"


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """Installed package with two solutions that can be read, and three that cannot."""
    places = {
        "free-mass": "carts:FREE_MASS",
        "rays": "carts:FREE_MASS",
        "lost": "carts.lost:X",
        "function": "carts:solution",
        "broken": "carts.broken:X",
    }
    files = {"carts/__init__.py": SOLUTIONS, "carts/broken.py": "1 / 0\n"}
    monkeypatch.syspath_prepend(install(tmp_path, "carts", files, {GROUP: places}))
    yield
    for name in [name for name in sys.modules if name.partition(".")[0] == "carts"]:
        del sys.modules[name]


def named(name: str, **links) -> dict:
    return CART | {"exact": {"name": name}, "links": {"push": CART["links"]["push"] | links}}


@pytest.mark.filterwarnings("ignore:rays of the entry points")
def test_a_case_names_a_solution_of_another_package():
    case = fvsolve.load(named("free-mass"))
    found = exact.solution(case, None).probe(case.probes[0], np.array([0.0, 1.0]))
    assert found.tolist() == [0.0, 2.0]
    force = {"kind": "linear", "time": [0.0, 1.0], "value": [0.0, 1.0]}
    with pytest.raises(CaseError, match="links.push.force: .*needs a constant force"):
        fvsolve.load(named("free-mass", force=force))


@pytest.mark.filterwarnings("ignore:rays of the entry points")
@pytest.mark.parametrize(
    "name, error, message",
    [
        (
            "free-mas",
            CaseError,
            'exact.name: no exact solution named "free-mas"; did you mean "free-mass"?',
        ),
        (
            "lost",
            FvsolveError,
            "lost of .* carts.lost:X cannot be read: No module named 'carts.lost'; correct or",
        ),
        (
            "broken",
            FvsolveError,
            "broken of .* carts: carts.broken:X cannot be read: division by zero; correct or",
        ),
        (
            "function",
            FvsolveError,
            "function of .* carts:solution cannot be read: it is not an Exact; expected",
        ),
    ],
)
def test_a_name_that_cannot_be_used_is_explained(name, error, message):
    with pytest.raises(error, match=message):
        fvsolve.load(named(name))


def test_a_built_in_name_stays_built_in():
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # no other package is read
        assert exact.NAMES.load("rays").links == ("pipe", "valve", "orifice")
        assert (
            fvsolve.load(CASES / "two-tanks.toml").exact.name == "levelling"
            and "carts" not in sys.modules
        )
    with pytest.warns(
        RuntimeWarning,
        match='rays of .* carts: carts:FREE_MASS cannot be read: .* "rays" exists already',
    ):
        assert len({*exact.NAMES}) == 7 + 4


def test_headers_state_the_names_of_their_solutions():
    found = [match["name"] for _, match in headers(("exact/*.py",), exact.HEADER)]
    assert len({*found}) == len(found) == 7
    assert [exact.NAMES.load(name).name for name in found] == found
