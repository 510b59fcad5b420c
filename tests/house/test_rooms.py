"""Tests stand in folders as the rooms of the package do."""

from __future__ import annotations

from pathlib import Path

from truth import folders

import fvsolve

OF_TESTS = {"house", "restated", "truth"}  # what joins rooms of the package, or none has


def test_every_test_stands_in_a_room_of_the_package_or_one_of_the_tests_own():
    tests = folders.CASES.parent / "tests"
    stand = {path.parent.relative_to(tests).as_posix() for path in tests.rglob("test_*.py")}
    assert stand - OF_TESTS <= {path.stem for path in Path(fvsolve.__file__).parent.iterdir()}
