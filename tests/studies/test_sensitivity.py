"""Sensitivity indices: closed forms of functions, and indices of runs from their quantitys."""

import json
import math

import numpy as np
import pytest
from pytest import approx
from reference.scenes import NO_FRICTION, junction, pipe, reservoir, scene, valve

from fvsolve.case.text import write
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies import sensitivity
from fvsolve.studies.sensitivity import Sensitivity

pytest.importorskip("SALib", reason="SALib is an extra")
A, B = 7.0, 0.1
CIRCLE = {name: (-math.pi, math.pi) for name in ("x1", "x2", "x3")}


def ishigami(x: dict) -> float:
    return math.sin(x["x1"]) + A * math.sin(x["x2"]) ** 2 + B * x["x3"] ** 4 * math.sin(x["x1"])


def test_the_ishigami_function_has_its_known_indices():
    """Closed forms of the variances of all terms (Ishigami and Homma 1990)."""
    first = [0.5 * (1 + B * math.pi**4 / 5) ** 2, A**2 / 8, 0.0]
    both = 8 * B**2 * math.pi**8 / 225  # term of x1 and x3
    whole = sum(first) + both
    found = sensitivity(ishigami, CIRCLE, samples=4096)
    assert found.S1 == approx([one / whole for one in first], abs=0.02)
    assert found.ST == approx([(first[0] + both) / whole, first[1] / whole, both / whole], abs=0.02)
    assert np.all(
        np.abs(np.array(found.S1) - [one / whole for one in first]) < 2.0 * np.array(found.S1_conf)
    )
    assert found.runs == 4096 * 5 + 1024 * 4 and found.quantity == "the function"
    # effects of both signs cancel
    assert found.mu_star[1] > 0.0 and found.mu[1] == approx(0.0, abs=0.5)


def test_a_line_has_its_slopes_whatever_its_units():
    """For a sum S1 = ST, in the ratio of squares of slope times range; all effects are equal, so sigma is zero."""
    found = sensitivity(
        lambda x: 1e9 + 3e-4 * x["a"] + 4e2 * x["b"],
        {"a": (0.0, 1e6), "b": (-0.5, 0.5)},
        samples=256,
    )
    assert found.S1 == approx([0.36, 0.64], abs=0.02) and found.ST == approx([0.36, 0.64], abs=0.02)
    assert found.mu_star == approx([300.0, 400.0], rel=1e-6) and found.sigma == approx(
        [0.0, 0.0], abs=1e-3
    )


def test_the_same_seed_gives_the_same_indices():
    one, same, other = (sensitivity(ishigami, CIRCLE, samples=32, seed=seed) for seed in (1, 1, 2))
    assert one.plain() == same.plain() != other.plain()


@pytest.fixture
def line() -> dict:
    """Case of a frictionless pipe shut at once: the first rise is rho a v."""
    nodes = {"lake": reservoir(3e6), "gate": junction(), "out": reservoir(101325.0)}
    main = pipe("lake", "gate", 100.0, 0.3, 1000.0, 5, friction=NO_FRICTION)
    links = {
        "main": main,
        "valve": valve("gate", "out", 0.001, {"start": 0.05, "duration": 0.0, "value": [1.0, 0.0]}),
    }
    numerics = {"scheme": "upwind", "method": "euler", "courant": 1.0}
    return scene(nodes, links, 0.15, numerics, ["gate.pressure"])


def test_of_joukowskys_rise_speed_and_opening_have_the_shares_that_a_product_has(line):
    """p = p0 + rho a v, v proportional to the valve area: V = V_a + V_v + V_av, from means and variances of both."""
    bounds = {"links.main.wave_speed": [900.0, 1300.0], "links.valve.area": [0.001, 0.002]}
    a, s = ((sum(one) / 2, (one[1] - one[0]) ** 2 / 12) for one in bounds.values())
    terms = a[1] * s[0] ** 2, s[1] * a[0] ** 2, a[1] * s[1]
    found = sensitivity(line, bounds, "max(gate.pressure)", samples=64)
    assert found.quantity == "max(gate.pressure) [Pa]"
    assert found.S1 == approx([one / sum(terms) for one in terms[:2]], abs=0.03)
    assert found.ST == approx([(one + terms[2]) / sum(terms) for one in terms[:2]], abs=0.03)
    # rise per speed and area
    rise = 0.61 * math.sqrt(2 * (3e6 - 101325.0) * 1000.0) / (math.pi / 4 * 0.3**2)
    assert found.mu_star == approx([rise * 0.0015 * 400.0, rise * 1100.0 * 0.001], rel=0.1)


def test_its_line_names_the_key_with_the_greatest_total_index():
    for strongest in range(3):
        totals = [0.1, 0.2, 0.3]
        totals[strongest] = 0.9
        found = Sensitivity(
            ("a.x", "b.y", "c.z"), "max(gate.pressure) [Pa]", 8, *[[0.0] * 3] * 2, totals, *[[0.0] * 3] * 5
        )  # fmt: skip
        name = ("a.x", "b.y", "c.z")[strongest]
        assert found.summary_line() == (
            f"of max(gate.pressure) [Pa] to 3 keys, 8 runs: greatest for {name}"
        )


def test_no_label_of_its_picture_covers_another_or_leaves_it():
    """Long keys with equal ends, and numbers of six digits."""
    from fvsolve.report.draw.object_pictures import sensitivity_figure

    keys = tuple(f"links.a-rather-long-name-{k}.opening.duration" for k in range(4))
    shares, effects = [0.1] * 4, [3e5, 2.96e5, 6e4, 4e3]
    found = Sensitivity(keys, "max(gate.pressure) [Pa]", 1, *[shares] * 4, *[effects] * 4)
    figure = sensitivity_figure(found)
    figure.canvas.draw()
    left, right = figure.axes
    texts = [axes.xaxis.label for axes in (left, right)] + left.get_yticklabels() + right.texts
    for axes in (left, right):
        low, high = axes.get_xlim()
        texts += [one for one in axes.get_xticklabels() if low <= one.get_position()[0] <= high]
    assert [one.get_text().replace("\n", "") for one in left.get_yticklabels()] == [*keys]
    boxes = [one.get_window_extent() for one in texts if one.get_text()]
    assert not [1 for k, one in enumerate(boxes) for other in boxes[:k] if one.overlaps(other)]
    assert all(box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0 for box in boxes)


def test_the_command_prints_it_and_reuses_its_runs(line, fvs, tmp_path):
    (tmp_path / "line.toml").write_text(write(line))
    ask = (
        "sensitivity",
        tmp_path / "line.toml",
        "--vary",
        "links.main.wave_speed=900 m/s,1300",
        "--vary",
        "nodes.out.pressure=1 atm,2 atm",
        "--quantity",
        "max(gate.pressure)",
        "--samples",
        4,
        "--out",
        tmp_path,
    )
    code, out, _ = fvs(*ask, "--json")
    said = json.loads(out)
    assert (
        code == 0
        and said["keys"] == ["links.main.wave_speed", "nodes.out.pressure"]
        and said["runs"] == 16 + 12
    )
    assert {"S1", "ST", "S1_conf", "mu_star", "sigma"} <= said.keys() and said["ST"][
        1
    ] < 0.02 < said["ST"][0]
    before = (tmp_path / "points.jsonl").read_bytes()
    code, out, _ = fvs(*ask)
    assert code == 0 and "28 runs" in out and (tmp_path / "points.jsonl").read_bytes() == before
    assert (tmp_path / "sensitivity.csv").read_text().startswith("key,S1,S1_conf,ST,")
    assert (tmp_path / "sensitivity.png").stat().st_size > 1000


def test_impossible_requests_are_named(line):
    bounds = {"links.main.wave_speed": [900.0, 1300.0]}
    for given, said in (
        ({"vary": bounds, "quantity": "max(gate.flow)"}, 'no quantity "max.gate.flow."'),
        ({"vary": bounds}, "no quantity; expected a quantity such as"),
        ({"vary": {}, "quantity": "max(gate.pressure)"}, "no key varies"),
        (
            {"vary": bounds, "quantity": "max(gate.pressure)", "samples": 1},
            "samples = 1 is too small; expected 2 or more",
        ),
        (
            {"vary": {"nodes.gate.position": [0.0, 1.0]}, "quantity": "max(gate.pressure)"},
            "is not a continuous quantity",
        ),
        (
            {"vary": {"fluid.viscosity": [1e-3, 2e-3]}, "quantity": "max(gate.pressure)"},
            "no key changes it",
        ),
        (
            {"vary": {"fluid.viscosity": ["1 cSt", "2 cSt"]}, "quantity": "max(gate.pressure)"},
            "is a kinematic viscosity",
        ),
        ({"vary": bounds, "quantity": "t [s]"}, 'no quantity "t .s."'),
    ):
        with pytest.raises(FvsolveError, match=said):
            sensitivity(line, **({"samples": 2} | given))
    with pytest.raises(CaseError, match="LOW below HIGH"):
        sensitivity(line, {"links.main.wave_speed": [1300.0, 900.0]}, "max(gate.pressure)")


def test_runs_that_have_no_quantity_are_counted_and_the_first_is_named(line):
    refused = {"links.main.wave_speed": [900.0, 1300.0]}
    blown = {"numerics.courant": 4.0, "numerics.end": 20.0}
    with pytest.raises(
        FvsolveError,
        match=r"runs ha(s|ve) no max\(gate.pressure\).*first at links.main.wave_speed = ",
    ):
        sensitivity(line, refused, "max(gate.pressure)", 2, set=blown)
