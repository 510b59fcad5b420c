"""List the claims of the tests, or the claims of a commit that are missing in the working tree.

    python tests/list_claims.py [COMMIT]

A claim is a test function: its file, its name, and the first line of its docstring.
"""

import ast
import io
import subprocess
import sys
import tarfile
from pathlib import Path

TOP = Path(__file__).parents[1]


def claims(files: dict[str, str]) -> dict[str, str]:
    """File and name of each test, and the first line of its docstring."""
    lines = {}
    for path, text in sorted(files.items()):
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and node.name.startswith(
                "test_"
            ):
                lines[f"{path}::{node.name}"] = (ast.get_docstring(node) or "").split("\n")[0]
    return lines


def of_tree() -> dict[str, str]:
    paths = (TOP / "tests").rglob("test_*.py")
    return {path.relative_to(TOP).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def of_commit(commit: str) -> dict[str, str]:
    """Test files of a commit, by path."""
    archive = subprocess.run(
        ["git", "archive", commit, "tests"], cwd=TOP, capture_output=True, check=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(archive)) as files:
        members = [member for member in files if Path(member.name).match("test_*.py")]
        return {member.name: files.extractfile(member).read().decode() for member in members}


def main() -> None:
    present = claims(of_tree())
    if len(sys.argv) < 2:
        print(*(f"{name}  {text}".rstrip() for name, text in present.items()), sep="\n")
        return
    before = claims(of_commit(sys.argv[1]))
    names = {name.split("::")[1] for name in present}
    gone = [name for name in before if name.split("::")[1] not in names]
    print(f"{len(before)} claims at {sys.argv[1]}, {len(present)} now; {len(gone)} gone")
    print(*(f"{name}  {before[name]}".rstrip() for name in gone), sep="\n")


if __name__ == "__main__":
    main()
