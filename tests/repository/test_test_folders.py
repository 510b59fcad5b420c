"""Folders of tests have the names of packages of fvsolve."""

from __future__ import annotations

from pathlib import Path

from reference import folders

import fvsolve

OTHERS = {"repository", "invariance", "reference"}  # tests of several packages or of none


def test_every_folder_of_tests_is_a_package_or_one_of_three_others():
    tests = folders.CASES.parent / "tests"
    stand = {path.parent.relative_to(tests).as_posix() for path in tests.rglob("test_*.py")}
    assert stand - OTHERS <= {path.stem for path in Path(fvsolve.__file__).parent.iterdir()}
