"""Measures of the structure of the package: each counts what it states, and no value passes its limit."""

import subprocess
from pathlib import Path

import pytest
from repository import structure
from repository.structure import LIMITS, MEASURES, TOP, Density, Limit


def write(root: Path, files: dict[str, str]) -> Path:
    """Folder with these files."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf8")
    return root


@pytest.mark.parametrize("measure", MEASURES)
def test_a_measure_is_within_its_limit(measure):
    assert structure.fault_of(MEASURES[measure](), LIMITS[measure]) == ""


def test_every_measure_has_a_limit():
    assert list(MEASURES) == list(LIMITS)


@pytest.mark.parametrize(
    "value, limit, fault",
    [
        (100, Limit(100, 50, 3), ""),
        (97, Limit(100, 50, 3), ""),
        (101, Limit(100, 50, 3), "worse"),
        (96, Limit(100, 50, 3), "better"),
        (1.0, Limit(1.0, 4.0, 0.2, True), ""),
        (0.9, Limit(1.0, 4.0, 0.2, True), "worse"),
        (1.3, Limit(1.0, 4.0, 0.2, True), "better"),
        (45, Limit(45, 46, 1), ""),
        (45.5, Limit(45, 46, 1), "worse"),
        (43.5, Limit(45, 46, 1), "better"),
        (0, Limit(0, 0, 0), ""),
        (1, Limit(0, 0, 0), "worse"),
    ],
)
def test_a_value_beyond_its_limit_or_far_from_it_is_a_fault(value, limit, fault):
    found = structure.fault_of(value, limit)
    assert (fault in found) if fault else found == ""


SOURCE = '''"""Text of a module.

# no comment
"""

# comment
x = 1  # not on a line of its own


class A:
    """Text of a class."""

    def f(self):
        """Text of a method."""
        # comment
        def inner(): return 2
        return inner

    async def g(self):
        return """text
# no comment
"""


h = lambda: 3
'''
LINES = [
    "x = 1  # not on a line of its own",
    "class A:",
    "    def f(self):",
    "        def inner(): return 2",
    "        return inner",
    "    async def g(self):",
    '        return """text',
    "# no comment",
    '"""',
    "h = lambda: 3",
]
COUNTS = Density(functions=3, lines=len(LINES), characters=sum(map(len, LINES)), comments=2)


def test_functions_code_lines_and_comments_of_a_text_are_counted():
    assert structure.density_of(SOURCE) == COUNTS


def test_densities_are_those_of_all_files_below_the_folders(tmp_path):
    root = write(
        tmp_path,
        {"a/one.py": SOURCE, "b/c/two.py": "# comment\ny = 2\n", "other/three.py": "z = 3\n"},
    )
    folders = root / "a", root / "b"
    assert structure.functions_per_1000_lines(*folders) == 1000 * 3 / 11
    assert structure.comments_per_100_lines(*folders) == 100 * 3 / 11
    assert structure.mean_line(*folders) == (COUNTS.characters + 5) / 11


def test_lines_and_features_of_imported_files_are_counted(tmp_path):
    files = {"a.py": "x = 1\ny = 2\n", "features/f/b.py": "z = 3\n", "core/features.py": ""}
    root = write(tmp_path, files)
    assert structure.lines_of(root, tuple(files)) == 3
    assert structure.in_features(tuple(files)) == 1


def test_a_simple_run_imports_the_command_line_and_no_pictures():
    files = structure.imported_files()
    assert {"cli/__init__.py", "core/kernels/dtypes.py", "core/solve/run_loop.py"} <= set(files)
    assert "report/draw/scene.py" not in files


HUB = '''"""Text with basins."""

delays = draft.past  # follows pipes
message = "pipes"
'''


def test_cells_are_words_of_features_in_hubs(tmp_path):
    root = write(
        tmp_path, {"a.py": HUB, "b.py": "network_start = 0\nnetwork_inputs = pipes_of = 1\n"}
    )
    found = structure.hub_matrix(root, ["a.py", "b.py"])
    assert found == {
        ("a.py", "basins"): {"basins": 1},
        ("a.py", "delay lines"): {"delays": 1, "past": 1},
        ("a.py", "pipes"): {"pipes": 2},
        ("b.py", "networks of other domains"): {"network_inputs": 1},
    }


def test_cells_of_the_code_alone_have_no_comments_and_docstrings(tmp_path):
    root = write(tmp_path, {"a.py": HUB})
    found = structure.hub_matrix(root, ["a.py"], code_alone=True)
    assert found == {
        ("a.py", "delay lines"): {"delays": 1, "past": 1},
        ("a.py", "pipes"): {"pipes": 1},
    }


def test_a_hub_that_moved_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"b\.py: unknown hub.* update HUBS"):
        structure.hub_matrix(write(tmp_path, {"a.py": HUB}), ["a.py", "b.py"])


@pytest.mark.parametrize(
    "arrows, found",
    [
        ({"a": {"b"}, "b": {"c"}, "c": set()}, []),
        ({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}, [["a", "b", "c"]]),
        ({"a": {"b"}, "b": {"a"}, "c": {"d", "a"}, "d": {"c"}}, [["a", "b"], ["c", "d"]]),
        ({"a": set()}, []),
    ],
)
def test_circles_are_strongly_connected_modules(arrows, found):
    assert structure.circles(arrows) == found


def test_imports_in_functions_and_for_type_checks_are_counted(tmp_path, monkeypatch):
    lazy = "def f():\n    from circle_of_three import a\n"
    typed = (
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from circle_of_three.b import f\n"
    )
    files = {"__init__.py": "", "a.py": "import circle_of_three.c\n", "b.py": lazy, "c.py": typed}
    write(tmp_path / "circle_of_three", files)
    monkeypatch.syspath_prepend(tmp_path)
    names = [f"circle_of_three.{name}" for name in "abc"]
    assert structure.circles(structure.imports("circle_of_three")) == [names]


def test_a_weaker_limit_is_detected():
    source = (
        'LIMITS = {"a": Limit(limit=9, goal=5, slack=0), '
        '"b": Limit(limit=1.5, goal=4, slack=0, more_is_better=True)}\n'
    )
    before = structure.limits_in(source)
    assert before == {"a": Limit(9, 5, 0), "b": Limit(1.5, 4, 0, True)}
    now = {"a": Limit(10, 5, 0), "b": Limit(1.2, 4, 0, True), "c": Limit(7, 0, 0)}
    assert structure.weakened(before, now) == {"a": 10, "b": 1.2}
    assert structure.weakened(before, {"a": Limit(8, 5, 0), "b": Limit(2.0, 4, 0, True)}) == {}
    page = "- 2026-12-01, a, 9 to 10: first reason.\n- 2026-12-02, a, 9.5 to 11: next reason.\n- 2026-12-02, b, 2 to 1:"
    assert structure.decisions_in(page) == {"a": 11}


def test_a_weaker_limit_has_its_reason():
    """Limits are compared with those of the last commit, so this test can fail only before a commit."""
    command = ["git", "show", "HEAD:tests/repository/structure.py"]
    committed = subprocess.run(command, cwd=TOP, capture_output=True, text=True)
    if committed.returncode:
        pytest.skip("no commits here")
    decided = structure.decisions_in((TOP / "docs/decisions.md").read_text(encoding="utf8"))
    for measure, limit in structure.weakened(structure.limits_in(committed.stdout), LIMITS).items():
        assert decided.get(measure) == limit, (
            f"{measure}: expected a line in docs/decisions.md that ends at {limit:g}"
        )
