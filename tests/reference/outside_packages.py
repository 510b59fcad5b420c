"""Installed packages outside the tree, for tests of what fvsolve finds in other packages."""

import os
import subprocess
import sys
from pathlib import Path

import fvsolve


def install(
    top: Path, name: str, files: dict[str, str], entry_points: dict[str, dict[str, str]]
) -> Path:
    """Write a package into a folder of modules, as pip installs it; returns this folder.

    files : path below the folder -> text; entry_points : group -> name -> place
    """
    for path, text in files.items():
        (top / path).parent.mkdir(parents=True, exist_ok=True)
        (top / path).write_text(text, encoding="utf-8")
    facts = top / f"{name}-1.0.dist-info"
    facts.mkdir(parents=True)
    (facts / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8"
    )
    rows = [
        row
        for group, places in entry_points.items()
        for row in (f"[{group}]", *(f"{one} = {place}" for one, place in places.items()))
    ]
    (facts / "entry_points.txt").write_text("\n".join([*rows, ""]), encoding="utf-8")
    return top


def python(
    home: Path, *arguments: str, code: int = 0, **environment: str
) -> subprocess.CompletedProcess:
    """Python process that can import the packages in a folder; it must end with the exit code."""
    paths = [
        str(home),
        str(Path(fvsolve.__file__).parents[1]),
        *filter(None, [os.environ.get("PYTHONPATH")]),
    ]
    known = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "MPLBACKEND": "Agg"} | environment
    done = subprocess.run(
        [sys.executable, *arguments], cwd=home, env=known, capture_output=True, text=True
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done
