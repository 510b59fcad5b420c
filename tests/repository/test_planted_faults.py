"""Faults of `tests/planted_faults.py` fit the present package."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import planted_faults
import pytest

import fvsolve

PACKAGE = Path(fvsolve.__file__).parent


@pytest.mark.parametrize("fault", planted_faults.FAULTS, ids=lambda fault: fault.path)
def test_each_fault_changes_one_place_and_still_compiles(fault):
    text = (PACKAGE / fault.path).read_text(encoding="utf-8")
    planted = fault.planted(text)
    assert planted != text
    compile(planted, fault.path, "exec")


def test_there_are_forty_two_and_each_folder_of_the_package_has_one():
    folders = {path.parent.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py")}
    folders.remove(Path("data"))  # printed tables, and one function that reads them
    of_parts = {folder for folder in folders if folder.parts[:1] == ("parts",) and len(folder.parts) > 1}
    count = Counter(Path(fault.path).parent for fault in planted_faults.FAULTS)
    assert sum(count.values()) == 42
    assert folders - of_parts <= set(count)
    assert sum(count[folder] for folder in count if folder.parts[:1] == ("parts",)) >= 4
