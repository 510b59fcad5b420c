"""Generic properties of a specimen of each kind of part and block, each feature, physics and density law.

A specimen is an entry of `reference/specimens.py`. The quick tests run each specimen with a single property, and all
others in turn.
"""

import copy
from typing import Any

import numpy as np
import pytest
from reference.jacobians import random_state, stray
from reference.specimens import PROPERTIES, SPECIMENS, Specimen

import fvsolve
from fvsolve.core.assembly.features import FEATURES, features_of
from fvsolve.core.fluid.laws import LAWS
from fvsolve.errors import FvsolveError
from fvsolve.parts import KINDS
from fvsolve.parts.basin import Physics
from fvsolve.parts.control import Control
from fvsolve.studies.linearise import linearise_at
from fvsolve.studies.operating_point import operating_point
from fvsolve.units import convert
from invariance.equivalent_networks import STRAIGHT, from_other_end, in_other_units, swapped
from invariance.result_comparison import EXPERIMENTAL, Outcome, alike, broken_off_and_whole

# other warnings fail, such as of NaN values
pytestmark = pytest.mark.filterwarnings("error", EXPERIMENTAL)
NAMED = ("nodes", "links", "controls")  # tables of names
TIGHT = {"numerics.rtol": 1e-9}
UNITS = {
    "pressure": "bar",
    "flow": "l/s",
    "head": "mm",
    "level": "cm",
    "velocity": "cm/s",
    "position": "mm",
    "force": "kN",
    "torque": "kN m",
    "time": "ms",
    "angular_velocity": "rpm",
    "angle": "deg",
}


def outcome_of(case: dict, settings: dict | None = None) -> Outcome:
    """Rows of a run that ends as planned."""
    result = fvsolve.run(case, settings or {})
    assert result.ok, result.reason
    return Outcome(
        "finished",
        np.array(result.t),
        {str(p): np.array(result[str(p)]) for p in result.probes},
        result,
    )


def ends_of(case: dict, settings: dict) -> np.ndarray:
    """Scaled final state of a case with changed settings."""
    model = fvsolve.build(fvsolve.load(case, settings))
    return (
        fvsolve.advance(model, fvsolve.initial_state(model), case["numerics"]["end"]).y
        / model.scale
    )


def ledger(specimen: Specimen) -> None:
    """Each ledger closes to rounding."""
    ledgers = outcome_of(specimen.case).result.ledger
    assert all(abs(one["relative"]) < 1e-10 for one in ledgers.values())


def restated(specimen: Specimen) -> None:
    """Parts in the opposite order, symmetric links from their other ends, and quantities in other units."""
    case = specimen.case
    turned = {name for name, link in case["links"].items() if link["type"] in STRAIGHT}
    other = in_other_units(swapped(case, turned))
    other |= {
        table: dict(reversed(other[table].items()))
        for table in ("nodes", "links", "controls")
        if table in other
    }

    def sign(probe: str, values: np.ndarray) -> np.ndarray:
        return -values if ".flow" in probe and probe.split(".")[1] in turned else values

    def name(probe: str) -> str:
        return from_other_end(probe, case, turned)

    alike(outcome_of(case), outcome_of(other), specimen.near["restated"], name, sign)


def bits(specimen: Specimen) -> None:
    """Two runs of a case have equal rows, to the bit."""
    alike(outcome_of(specimen.case), outcome_of(copy.deepcopy(specimen.case)))


def resumed(specimen: Specimen) -> None:
    """A run that was interrupted and resumed by a new model ends with the same bits and ledgers."""
    broken_off_and_whole(specimen.case, 0.5)


def linearised(specimen: Specimen) -> None:
    """The matrix A multiplies a random direction as differences of the rates do, or the state has no derivative."""
    if "linearised" in specimen.lacks:
        with pytest.raises(FvsolveError):
            linearise_at(operating_point(specimen.case))
        return
    at = operating_point(specimen.case)
    a, model, rng = linearise_at(at).a, at.model, np.random.default_rng(1)
    for _ in range(3):
        direction = model.scale * rng.normal(size=model.y_size)
        ahead, behind = (model.evaluate(at.t, at.y + size * direction)[0] for size in (1e-6, -1e-6))
        expected = (ahead - behind) / 2e-6
        assert a @ direction == pytest.approx(
            expected, rel=1e-5, abs=1e-5 * np.max(np.abs(expected))
        )


def pattern(specimen: Specimen) -> None:
    """No rate depends on a state outside the sparsity pattern of the Jacobian, at the start and near it."""
    model, rng = fvsolve.build(fvsolve.load(specimen.case)), np.random.default_rng(2)
    for size in (0.0, 1e-3, 1.0):
        state = model.start + size * random_state(model, rng)
        assert stray(model, 0.3 * specimen.case["numerics"]["end"], state) < 1e-7


def implicit(specimen: Specimen) -> None:
    """A run by an implicit method has the rows of an explicit run, within the tolerance of both."""
    explicit, other = (
        outcome_of(specimen.case, TIGHT | {"numerics.method": method})
        for method in ("dormand-prince", "radau-iia-5")
    )
    alike(explicit, other, specimen.near["implicit"])


def units(specimen: Specimen) -> None:
    """Rows in other units are the converted rows in SI."""
    plain = outcome_of(specimen.case)
    other = outcome_of(specimen.case, {"output.units": UNITS})
    for probe in plain.result.case.probes:
        values, unit = plain.rows[probe.text], other.result.units[probe.text]
        if probe.dimension in UNITS:
            assert unit == UNITS[probe.dimension]
            values = convert(values, probe.dimension, unit)
        assert np.allclose(other.rows[probe.text], values, rtol=1e-12, atol=0.0)


def order(specimen: Specimen) -> None:
    """Errors of a method of second order fall by four where the step is halved."""
    runs = [
        ends_of(
            specimen.case, {"numerics.method": "ssp-rk2", "numerics.step": specimen.step / 2**k}
        )
        for k in range(3)
    ]
    first, second = (np.linalg.norm(runs[k + 1] - runs[k]) for k in range(2))
    assert np.log2(first / second) == pytest.approx(2.0, abs=0.3)


def names(specimen: Specimen) -> None:
    """Other names of all parts and blocks, in the opposite alphabetical order, do not change any bit."""
    listed = sorted(
        {name for table in NAMED for name in specimen.case.get(table, ())}, reverse=True
    )
    mapping = {name: f"part-{k:03d}" for k, name in enumerate(listed)}
    other = outcome_of(renamed(specimen.case, mapping))
    alike(outcome_of(specimen.case), other, name=lambda probe: text_of(probe, mapping))


def renamed(case: dict, mapping: dict[str, str]) -> dict:
    """Case with new names of its parts and blocks, also where other parts, blocks and probes refer to them."""
    other = referring(case, mapping)
    return other | {
        table: {mapping[name]: one for name, one in other[table].items()}
        for table in NAMED
        if table in other
    }


def referring(value: Any, mapping: dict[str, str]) -> Any:
    """Value with the new names in all its texts, except those of kinds."""
    if isinstance(value, dict):
        return {
            key: one if key == "type" else referring(one, mapping) for key, one in value.items()
        }
    if isinstance(value, list):
        return [referring(one, mapping) for one in value]
    return text_of(value, mapping) if isinstance(value, str) else value


def text_of(text: str, mapping: dict[str, str]) -> str:
    """Reference such as "tank", "tank.level" or "nodes.tank.level" with the new name of its part."""
    return ".".join(mapping.get(word, word) for word in text.split("."))


HOLDS = {
    "ledger": ledger,
    "restated": restated,
    "bits": bits,
    "resumed": resumed,
    "linearised": linearised,
    "pattern": pattern,
    "implicit": implicit,
    "units": units,
    "order": order,
    "names": names,
}


@pytest.mark.quick_in_turn
@pytest.mark.parametrize("name", SPECIMENS)
@pytest.mark.parametrize("of", PROPERTIES)
def test_a_specimen_has_the_property(request, name, of):
    specimen = SPECIMENS[name]
    if of == "order" and of in specimen.lacks:
        pytest.skip(specimen.lacks[of])
    HOLDS[of](specimen)


def test_every_kind_of_part_block_feature_physics_and_law_has_a_specimen():
    declared = {
        "part": {kind for kinds in KINDS.values() for kind in kinds},
        "block": set(Control.kinds),
        "feature": set(FEATURES.own()),
        "physics": set(Physics.kinds),
        "law": set(LAWS),
    }
    present: dict[str, set] = {group: set() for group in declared}
    for specimen in SPECIMENS.values():
        case = fvsolve.load(specimen.case)
        present["part"] |= {part.kind for part in (*case.nodes.values(), *case.links.values())}
        present["block"] |= {block["type"] for block in specimen.case.get("controls", {}).values()}
        present["feature"] |= {type(feature).__name__ for feature in features_of(case)}
        present["physics"] |= {node.physics for node in case.nodes.values() if node.kind == "basin"}
        present["law"].add(case.fluid.law)
    assert {
        group: names - present[group] for group, names in declared.items() if names - present[group]
    } == {}
