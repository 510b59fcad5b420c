"""No module of the package imports, through whatever others and wherever it says so, itself."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

import grimp
import pytest


def circle(arrows: dict[str, set[str]]) -> list[str]:
    """A circle among arrows; none where they can be put in a row."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_imports_run_in_no_circle():
    graph = grimp.build_graph("fvsolve", exclude_type_checking_imports=True, cache_dir=None)
    found = circle({module: graph.find_modules_directly_imported_by(module) for module in graph.modules})
    assert not found, " -> ".join(found)


@pytest.mark.parametrize(
    "arrows, found", [({"a": {"b"}, "b": {"c"}, "c": {"a"}}, 4), ({"a": {"b", "c"}, "b": {"c"}}, 0)]
)
def test_a_circle_is_seen(arrows, found):
    assert len(circle(arrows)) == found
