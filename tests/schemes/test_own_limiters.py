"""Limiters of users: equal to built-in limiters of the same formula, tested at registration, seen by every command."""

import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pytest import approx
from reference import basins, folders, pulses
from reference.scenes import lake, pipe, reservoir, scene, valve

import fvsolve
from fvsolve.case import load
from fvsolve.core.kernels.own_limiters import LOOPS, loops_of
from fvsolve.core.schemes import LIMITERS
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies import order, sweep
from fvsolve.studies.stability.periodic_limits import limited_limit, monotone_limit

KAPPA = 1.0
SIZE = {"type": "basin", "size": [4.0, 2.0], "cells": [20, 8]}
WAVES = {"level": "1 + 0.2*cos(pi*x/4)*cos(pi*y/2)"}
POOLS = {
    "water": SIZE | {"level": 1.0, "start": WAVES},
    "liquid": SIZE
    | {
        "physics": "liquid",
        "pressure": 2e6,
        "thickness": 0.1,
        "start": {"pressure": "2e6 + 1e5*cos(pi*x/4)*cos(pi*y/2)"},
    },
}


def van_leer(r):
    return (r + abs(r)) / (1.0 + abs(r))


def minmod(r):
    return max(0.0, min(1.0, r))


def monotonized_central(r):
    return max(0.0, min(2.0 * r, 0.5 * (1.0 + r), 2.0))


def superbee(r):
    return max(0.0, min(2.0 * r, KAPPA), min(r, 2.0))


def koren(r):
    return max(0.0, min(2.0 * r, (1.0 + 2.0 * r) / 3.0, 2.0))


SAME = {"van-leer": van_leer, "minmod": minmod, "monotonized-central": monotonized_central}


pytestmark = pytest.mark.usefixtures("own_limiters_removed")


def main(limiter: str, **numerics) -> dict:
    """A valve closes at the end of a pipe; the lake sends a tracer."""
    numerics = {
        "scheme": "muscl",
        "method": "ssp-rk2",
        "courant": 0.6,
        "limiter": limiter,
        **numerics,
    }
    dye = {"time": [0.0, 0.2, 0.4], "value": [0.0, 1.0, 0.3], "kind": "linear"}
    nodes = {
        "lake": lake(45.0, scalars={"dye": dye}),
        "a": {"type": "junction"},
        "low": reservoir(101325.0),
    }
    links = {"main": pipe("lake", "a", 20.0, 0.3, 1000.0, 12), "gate": valve("a", "low", 0.05)}
    links["gate"]["opening"] = {"start": 0.05, "duration": 0.02, "value": [1.0, 0.9]}
    return scene(
        nodes, links, 0.6, numerics, ["a.pressure"], every=0.05, scalars={"dye": {"initial": 0.0}}
    )


def pool(kind: str, limiter: str, **numerics) -> dict:
    """Waves in a closed basin, with a scalar in water."""
    numerics = {
        "scheme": "muscl",
        "method": "ssp-rk2",
        "courant": 0.6,
        "limiter": limiter,
        **numerics,
    }
    end, water = (1.0, True) if kind == "water" else (2e-3, False)
    given = POOLS[kind] | ({"scalars": {"dye": "exp(-(x - 1)^2 - y^2)"}} if water else {})
    more = {"scalars": {"dye": {"initial": 0.0}}} if water else {}
    made = scene({"pool": given}, {}, end, numerics, (), end, **more)
    return {key: value for key, value in made.items() if key != "links"}


def final(case: dict) -> np.ndarray:
    """State at the end of a run."""
    return basins.ended(case)[1].y


def run_python(folder: Path, code: str, **more: str) -> str:
    """Output of another process."""
    paths = {"PYTHONPATH": str(Path(fvsolve.__file__).parents[1])}
    paths["PYTHONDONTWRITEBYTECODE"] = "1"  # bytecode files do not show an edit within a second
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=os.environ | paths | more,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


STEPS = {"explicit": {}, "implicit": {"method": "implicit-midpoint", "courant": 1.5}}


@pytest.mark.in_turn
@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("name", SAME)
def test_a_built_in_limiter_written_again_gives_the_same_run_of_a_pipe(name, steps):
    """Also of a scalar in it; the other limiters give another run."""
    fvsolve.register_limiter("mine", SAME[name])
    runs = {limiter: final(main(limiter, **STEPS[steps])) for limiter in ("mine", *SAME)}
    scale = np.abs(runs["mine"]).max()
    apart = {limiter: np.abs(run - runs["mine"]).max() / scale for limiter, run in runs.items()}
    assert apart.pop(name) < (1e-10 if steps == "implicit" else 1e-13)
    assert min(other for limiter, other in apart.items() if limiter != "mine") > 1e-5, apart


@pytest.mark.in_turn
@pytest.mark.parametrize("kind", POOLS)
@pytest.mark.parametrize("steps", STEPS)
def test_and_the_same_run_of_a_basin(kind, steps):
    fvsolve.register_limiter("mine", van_leer)
    mine, built_in, other = (
        final(pool(kind, name, **STEPS[steps])) for name in ("mine", "van-leer", "minmod")
    )
    scale = np.abs(built_in).max()
    assert np.abs(mine - built_in).max() < (1e-9 if steps == "implicit" else 1e-12) * scale
    assert np.abs(other - built_in).max() > 1e-4 * scale


def test_a_liquid_of_another_law_calls_it():
    """Nonlinear laws have other loops than `linear`."""
    fvsolve.register_limiter("mine", van_leer)
    cases = [pool("liquid", name) for name in ("mine", "van-leer")]
    mine, built_in = (final(case | {"fluid": {**case["fluid"], "law": "log"}}) for case in cases)
    assert np.abs(mine - built_in).max() < 1e-12 * np.abs(built_in).max()


def test_a_limiter_that_depends_on_direction_runs_in_pipes_and_is_refused_in_basins():
    """Mirrored slopes at a wall would differ, and mass would leave through it."""
    fvsolve.register_limiter("third", koren)
    assert np.isfinite(final(main("third"))).all()
    with pytest.raises(
        FvsolveError, match=r"third is not symmetric: .*; expected a limiter with phi\(r\) / r"
    ):
        basins.model_of(pool("water", "third"))


def test_its_order_is_2_in_smooth_flow_and_1_if_phi_of_1_is_not_1():
    fvsolve.register_limiter("mine", monotonized_central)
    fvsolve.register_limiter("half", lambda r: 0.5 * van_leer(r))
    for name, expected in (("mine", 2.0), ("half", 1.0)):
        found = order(pulses.case(40, points=pulses.FEW, limiter=name), schemes="muscl", levels=4)
        assert found.fits["pressure"]["L1"].order == approx(expected, abs=0.35), name
        assert any(note.startswith(f"limiter {name}: ") for note in found.notes) == (
            expected < 2
        ), name


def test_a_limiter_outside_of_the_region_runs_with_a_single_notice():
    """It names the places; superbee, on the edge of the region, has none."""
    fvsolve.register_limiter("edge", superbee)
    fvsolve.register_limiter("central", lambda r: 1.0)
    fvsolve.register_limiter("third", koren)
    texts = {
        name: [n.text for n in basins.model_of(main(name)).warnings if n.kind == "limiter"]
        for name in ("edge", "central", "third", "minmod")
    }
    assert not texts["edge"] + texts["minmod"] and len(texts["central"]) == len(texts["third"]) == 1
    (central,), (third,) = texts["central"], texts["third"]
    assert "from r = -1e+15 to 0.475" in central and "Sweby" in central
    assert "is not phi(1 / r)" in third and "Sweby" not in third
    assert not [
        n for n in basins.model_of(main("central", scheme="upwind")).warnings if n.kind == "limiter"
    ]


def test_total_variation_grows_only_outside_of_the_region():
    """The bound of Harten (1983) is that of the built-in limiter; outside of the region there is none."""
    fvsolve.register_limiter("mine", van_leer)
    fvsolve.register_limiter("central", lambda r: 1.0)
    assert monotone_limit("mine", "ssp-rk2") == approx(
        monotone_limit("van-leer", "ssp-rk2"), rel=1e-6
    )
    assert monotone_limit("central", "ssp-rk2") is None


def test_stability_has_the_branches_of_its_slope():
    """Tangents are measured: those of a built-in limiter are found again, with their limits."""
    for name, function in SAME.items():
        fvsolve.register_limiter("mine", function)
        assert set(LIMITERS[name].branches.items()) <= set(LIMITERS["mine"].branches.items()), name
        assert LIMITERS["mine"].steepest == approx(LIMITERS[name].steepest) and LIMITERS[
            "mine"
        ].overshoot == approx(LIMITERS[name].overshoot)
    assert len(LIMITERS["mine"].branches) == len(LIMITERS["monotonized-central"].branches)
    found, expected = (
        limited_limit("muscl", one, "ssp-rk2", 24, 60) for one in ("mine", "monotonized-central")
    )
    assert found.frozen == expected.frozen and found.measured == expected.measured


def test_another_function_under_the_name_replaces_it():
    """A changed global of the function counts too; a model built before keeps its limiter."""
    fvsolve.register_limiter("mine", minmod)
    before = basins.model_of(main("mine"))
    fvsolve.register_limiter("mine", superbee)
    sharp = final(main("mine"))
    try:
        globals()["KAPPA"] = 0.5
        fvsolve.register_limiter("mine", superbee)
        assert np.abs(final(main("mine")) - sharp).max() > 1e-5 * np.abs(sharp).max()
    finally:
        globals()["KAPPA"] = 1.0
    kept = fvsolve.advance(before, fvsolve.initial_state(before), 0.6).y
    assert np.abs(kept - final(main("minmod"))).max() < 1e-12 * np.abs(kept).max()


RESTART = """
import sys, fvsolve, mine
fvsolve.register_limiter("mine", mine.phi)
print(float(fvsolve.run(%r)["a.pressure"].sum()), "numba" in sys.modules)
"""


def test_an_edited_file_counts_in_the_next_process_and_an_unchanged_file_compiles_nothing(tmp_path):
    code = RESTART % (main("mine"),)
    found = []
    for factor in ("2.0", "2.0", "0.0"):
        (tmp_path / "mine.py").write_text(
            f"def phi(r):\n    return {factor} * max(0.0, min(1.0, r)) / 2.0\n"
        )
        value, compiled = run_python(tmp_path, code).split()
        found.append((float(value), compiled))
    assert found[1] == (found[0][0], "False")
    assert abs(found[2][0] - found[0][0]) > 1e-6 * found[0][0]


def test_other_processes_of_a_sweep_have_it():
    """Even a function without a file, as in a notebook."""
    fvsolve.register_limiter("mine", eval("lambda r: max(0.0, min(1.0, r))"))
    runs = {
        name: sweep(main(name), {"numerics.courant": [0.5, 0.7]}, jobs=2).table_columns()
        for name in ("mine", "minmod")
    }
    for column, values in runs["minmod"].items():
        if "a.pressure" in column:
            assert list(runs["mine"][column]) == approx(list(values), rel=1e-12)


def test_a_file_can_be_named_for_the_command_line(tmp_path):
    (tmp_path / "mine.py").write_text("def phi(r):\n    return max(0.0, min(1.0, r))\n")
    code = "import fvsolve.parts; from fvsolve.core.schemes import LIMITERS; print(*LIMITERS)"
    assert run_python(tmp_path, code, FVSOLVE_LIMITERS="sharp=mine.py:phi").split()[-1] == "sharp"
    code = "import warnings; warnings.simplefilter('error'); import fvsolve.parts"
    with pytest.raises(AssertionError, match=r"sharp=none\.py:phi cannot be read"):
        run_python(tmp_path, code, FVSOLVE_LIMITERS="sharp=none.py:phi")


def test_an_installed_package_can_offer_a_limiter(tmp_path):
    (tmp_path / "mine.py").write_text("def phi(r):\n    return max(0.0, min(1.0, r))\n")
    info = tmp_path / "mine-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[fvsolve.limiters]\nsharp = mine:phi\n")
    code = "import fvsolve.parts; from fvsolve.core.schemes import LIMITERS; print(*LIMITERS)"
    assert run_python(tmp_path, code).split()[-1] == "sharp"


TABLE = [1.0, 2.0]


@pytest.mark.parametrize(
    ("name", "function", "words"),
    [
        ("van-leer", van_leer, '"van-leer" is built in'),
        ("a b", van_leer, "letters, digits"),
        ("mine", lambda r: math.sqrt(r), r"mine\(-1e\+15\) fails: .*expected a number"),
        (
            "mine",
            lambda r: r / abs(r) if r else math.nan,
            r"mine\(0\) is nan; expected a finite number",
        ),
        ("mine", lambda r: r > 0.0, r"is False; expected a finite number"),
        ("mine", lambda r: (r, 1.0), r"is \(-1000000000000000.0, 1.0\)"),
        ("mine", lambda r: TABLE[0] * r, "name 'TABLE' is not defined"),
        ("mine", "phi", "expected a function"),
        ("mine", math.atan, "is a builtin_function_or_method; expected a Python function"),
    ],
)
def test_invalid_limiters_are_refused(name, function, words):
    before = dict(LIMITERS)
    with pytest.raises(FvsolveError, match=words):
        fvsolve.register_limiter(name, function)
    assert before == LIMITERS


def test_an_unknown_name_lists_it():
    fvsolve.register_limiter("mine", superbee)
    with pytest.raises(
        CaseError, match='no limiter named "quickest"; expected one of .*monotonized-central, mine'
    ):
        load(main("quickest"))


def test_a_function_that_numba_cannot_compile_is_refused_with_its_reason():
    def phi(r):
        return float(f"{max(0.0, min(1.0, r)):.17g}")

    fvsolve.register_limiter("mine", phi)
    with pytest.raises(
        FvsolveError,
        match="function of mine cannot be compiled: .*; expected a function of a float",
    ):
        basins.model_of(main("mine"))


def test_other_names_of_modules_and_functions_of_functions_are_located():
    """Closures, constants, members of numpy and compiled functions keep their values."""
    import numba

    one = numba.njit(lambda r: np.minimum(1.0, r))
    zero = 0.0

    def phi(r, least=0.0):
        return max(zero, least, one(r))

    fvsolve.register_limiter("mine", phi)
    given, expected = final(main("mine")), final(main("minmod"))
    assert np.abs(given - expected).max() < 1e-13 * np.abs(expected).max()


def test_every_loop_with_a_limiter_is_in_the_table():
    """A loop that is missing would end the compilation of a kernel."""
    sources = [path.read_text() for path in Path(fvsolve.__file__).parent.rglob("*.py")]
    listed = {*LOOPS, *loops_of("fvsolve.features.basins.advection")}
    called = {
        name
        for text in sources
        for name in listed
        if re.search(rf"by_(limiter|scheme)\(\s*{name},", text)
    }
    assert called == listed and LOOPS.keys() < listed


def test_the_example_of_the_page_shows_the_orders_that_it_states(capsys):
    section = (
        folders.page("choosing-a-method").split("## A limiter of your own")[1].split("\n## ")[0]
    )
    (code,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    exec(compile(code, "example", "exec"), {})
    stated = [float(x) for x in re.findall(r"levels: (.*)", code)[0].split(",")]
    assert [float(x) for x in capsys.readouterr().out.strip("()\n").split(",")] == approx(
        stated, abs=0.005
    )
