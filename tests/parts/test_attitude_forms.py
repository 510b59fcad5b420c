"""Forms of an attitude in a case file against SciPy, and the faults of forms that are wrong or disagree."""

from typing import Annotated

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError
from reference.refusals import refused
from reference.scenes import scene
from scipy.spatial.transform import Rotation

from fvsolve import load
from fvsolve.parts.attitude_keys import Attitude
from fvsolve.parts.table_model import Nested, Table
from fvsolve.parts.value import pydantic_faults

QUARTER = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


class Stand(Table):
    attitude: Annotated[Attitude | None, Nested(Attitude, "of a stand")] = None


def read(**given) -> Attitude:
    return Stand.model_validate({"attitude": given}).attitude


def faults(**given) -> dict[str, str]:
    with pytest.raises(ValidationError) as found:
        read(**given)
    return {
        ".".join(map(str, keys)): text
        for keys, text in pydantic_faults(found.value, ["attitude"], {})
    }


def notes(one: Attitude) -> list[tuple[str, str]]:
    return [(keys[0], text) for keys, _, _, text in one.unusual()]


SAID = {
    "roll alone": ({"roll": "30 deg"}, Rotation.from_euler("x", 30, degrees=True)),
    "roll, pitch, yaw": (
        {"roll": 0.1, "pitch": "-20 deg", "yaw": 2},
        Rotation.from_euler("ZYX", [2, -np.pi / 9, 0.1]),
    ),
    "zyz": ({"zyz": [0.1, "20 deg", -1]}, Rotation.from_euler("ZYZ", [0.1, np.pi / 9, -1.0])),
    "axis": (
        {"axis": [0, 0.6, 0.8], "angle": "40 deg"},
        Rotation.from_rotvec(np.radians([0, 24, 32])),
    ),
    "Euler parameters": (
        {"euler_parameters": [0.6, 0, 0.8, 0]},
        Rotation.from_quat([0, 0.8, 0, 0.6]),
    ),
    "matrix": ({"matrix": QUARTER}, Rotation.from_euler("z", 90, degrees=True)),
    "nothing": ({}, Rotation.identity()),
}


@pytest.mark.parametrize("form", SAID)
def test_a_form_is_scipy_s(form):
    given, wanted = SAID[form]
    one = read(**given)
    assert_allclose(one.rotation, wanted.as_matrix(), rtol=0, atol=1e-15)
    assert_allclose(
        Rotation.from_quat(one.parameters, scalar_first=True).as_matrix(),
        one.rotation,
        rtol=0,
        atol=1e-15,
    )
    assert not notes(one)
    assert read(**one.table()) == one


def test_forms_that_agree_may_stand_together():
    turn = Rotation.from_euler("ZYX", [0.3, -0.4, 0.2])
    vector = turn.as_rotvec()
    one = read(
        **{"roll": 0.2, "pitch": -0.4, "yaw": 0.3, "zyz": [*turn.as_euler("ZYZ")]},
        **{"axis": [*vector / turn.magnitude()], "angle": turn.magnitude()},
        **{
            "euler_parameters": [*turn.as_quat(scalar_first=True)],
            "matrix": turn.as_matrix().tolist(),
        },
    )
    assert_allclose(one.rotation, turn.as_matrix(), rtol=0, atol=1e-15)
    assert not notes(one)


def test_forms_that_disagree_are_named_with_the_angle_between_them():
    found = faults(yaw="90 deg", axis=[0, 0, 1], angle="80 deg", matrix=QUARTER)
    assert found == {
        "attitude.axis": "is 10 deg from the attitude that roll, pitch, yaw give; expected the same rotation"
    }
    found = faults(axis=[0, 0, 1], angle="80 deg", matrix=QUARTER, euler_parameters=[1, 0, 0, 0])
    assert found == {
        "attitude.euler_parameters": "is 80 deg from the attitude that axis gives; expected the same rotation",
        "attitude.matrix": "is 10 deg from the attitude that axis gives; expected the same rotation",
    }


def test_a_direction_of_another_length_is_normalised_with_a_notice():
    one = read(axis=[1, 1, 0], angle="90 deg")
    assert notes(one) == [
        ("axis", "the vector has length 1.41421, not 1, and is divided by this length")
    ]
    wanted = Rotation.from_rotvec(np.pi / 2**1.5 * np.array([1, 1, 0]))
    assert_allclose(one.rotation, wanted.as_matrix(), rtol=0, atol=1e-15)
    assert notes(read(euler_parameters=[0, 0, 0, -3]))[0][0] == "euler_parameters"


def test_rounded_digits_are_a_notice_and_no_fault():
    typed = [[0.8660, -0.5, 0], [0.5, 0.8660, 0], [0, 0, 1]]
    one = read(matrix=typed)
    assert notes(one) == [
        (
            "matrix",
            "is not exactly a rotation: R'R differs from the identity by 4.4e-05; the nearest rotation is used",
        )
    ]
    assert_allclose(
        one.rotation,
        Rotation.from_euler("z", np.arctan2(0.5, 0.866)).as_matrix(),
        rtol=0,
        atol=1e-15,
    )
    one = read(matrix=typed, yaw="30.01 deg")  # the matrix has atan(0.5 / 0.866) = 30.00073 deg
    assert notes(one)[1] == (
        "matrix",
        "is 0.00927 deg from the attitude that roll, pitch, yaw give; the latter is used",
    )
    assert_allclose(
        one.rotation, Rotation.from_euler("z", 30.01, degrees=True).as_matrix(), rtol=0, atol=1e-15
    )


BAD = {
    "no rotation": (
        {"matrix": [[1, 0, 0], [0, 1, 0], [0, 0.1, 1]]},
        {"matrix": "R'R differs from the identity by 0.1"},
    ),
    "a mirror": ({"matrix": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, {"matrix": "a reflection: its determinant is -1"}),
    "zeros": (
        {"axis": [0, 0, 0], "angle": 1, "euler_parameters": [0, 0, 0, 0]},
        {"axis": "has zero length", "euler_parameters": "has zero length"},
    ),
    "axis alone": ({"axis": [0, 0, 1]}, {"axis": "needs the key `angle` too"}),
    "angle alone": ({"angle": 1}, {"angle": "needs the key `axis` too"}),
    "unit": ({"yaw": "3 m", "zyz": [1, "2 kg", 3]}, {"yaw": '"3 m" is a length', "zyz.1": '"2 kg" is a mass'}),
    "sizes": (
        {"matrix": [[1, 0], [0, 1]], "euler_parameters": [1, 0, 0]},
        {"matrix": "expected three rows of three", "euler_parameters": "has 3 values; expected 4"},
    ),
    "row": ({"matrix": [[1, 0, 0], [0, 1], [0, "x", 1]]}, {"matrix.1": "expected 3", "matrix.2.1": "not a number"}),
    "key": ({"rol": 1}, {"rol": 'did you mean "roll"?'}),
    "key of others": ({"quaternion": [1, 0, 0, 0]}, {"quaternion": "use euler_parameters = [eta, e1, e2, e3]"}),
    "not finite": ({"euler_parameters": [float("nan"), 0, 0, 0]}, {"euler_parameters.0": "not finite"}),
    "no form that can be read": (  # the forms that can be read are not compared
        {"pitch": "x", "yaw": "90 deg", "matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
        {"pitch": "not a number"},
    ),
    "all at once": (
        {"axis": [0, 0, 0], "angle": "m", "matrix": 2 * [[2, 0, 0]] + [[0, 0, 1]], "yaw": 0, "zyz": [0, 1, 0], "x": 1},
        {
            "axis": "has zero length",
            "angle": "not a number",
            "matrix": "from the identity by 7",
            "zyz": "is 57.3 deg from the attitude",
            "x": "unknown key",
        },
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_shapes_that_do_not_fit_are_named(what):
    given, wanted = BAD[what]
    found = faults(**given)
    assert {*found} == {f"attitude.{key}" for key in wanted}
    for key, text in wanted.items():
        assert text in found[f"attitude.{key}"]


def test_a_case_has_its_notes_and_faults_with_their_places():
    """The key path of the attitude of a joint names both tables below the part."""
    body = {
        "type": "body",
        "mass": 1.0,
        "inertia": [1.0, 1.0, 1.0],
        "joint": {"attitude": {"axis": [0, 0, 2]}},
    }
    case = scene({"arm": body}, {}, 1.0, {"method": "rk4", "step": 0.1})
    error = refused(case)
    assert [(one.place, one.message) for one in error.faults] == [
        ("nodes.arm.joint.attitude.axis", "needs the key `angle` too")
    ]
    body["joint"]["attitude"]["angle"] = 30
    assert [
        (one.key, one.value, one.text.split(": ")[1])
        for one in load(scene({"arm": body}, {}, 1.0, {})).notices
    ] == [
        (
            "joint.attitude.angle",
            30.0,
            '30 rad is outside -6.3 to 6.3 rad, one turn in either direction; did you mean "30 deg"?',
        ),
        (
            "joint.attitude.axis",
            2.0,
            "the vector has length 2, not 1, and is divided by this length",
        ),
    ]


def test_a_missing_table_is_reported_with_the_expected_form():
    with pytest.raises(ValidationError) as found:
        Stand.model_validate({"attitude": "30 deg"})
    assert "not a table; expected keys of angle, axis, euler_parameters" in str(found.value)


def test_its_schema_describes_its_keys():
    said = Stand.model_json_schema()["properties"]["attitude"]
    assert said["properties"]["matrix"]["minItems"] == 3 and not said["additionalProperties"]
