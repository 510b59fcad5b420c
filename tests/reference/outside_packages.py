"""Installed packages outside the tree, for tests of what fvsolve finds in other packages."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
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


def files_of(text: str) -> dict[str, str]:
    """Files on a page: path -> text."""
    return dict(re.findall(r"`([\w./]+\.\w+)`[^`]*?:\n\n```\w+\n(.*?)```", text, re.DOTALL))


def runs_of(text: str) -> list[tuple[str, str]]:
    """Commands on a page with the text that they print: (commands, text), "" without a text."""
    return re.findall(r"```sh\n(.*?)```(?:\n\n```text\n(.*?)```)?", text, re.DOTALL)


def install_page(top: Path, files: dict[str, str], *folders: str) -> Path:
    """Install the package of a page; folders : packages without a text, whose `__init__.py` is empty"""
    project = tomllib.loads(files["pyproject.toml"])["project"]
    texts = {name: text for name, text in files.items() if name != "pyproject.toml"}
    empty = {f"{folder}/__init__.py": "" for folder in folders}
    return install(top, project["name"], texts | empty, project["entry-points"])


def lines_not_printed(home: Path, commands: str, output: str) -> list[str]:
    """Lines of the text below commands of a page that the commands do not print, except "..."; at least one is shown.

    A text of a fault, which begins with "  --set", is that of a command that ends with the exit code 2.
    """
    code, done = 2 * output.startswith("  --set"), ""
    for line in commands.splitlines():
        program, *words = shlex.split(line)
        if program == "cat":
            done += (home / words[0]).read_text("utf-8")
        elif program == "fvsolve":
            found = python(home, "-m", "fvsolve", *words, code=code)
            done += found.stdout + found.stderr
    shown = [line for line in output.splitlines() if line != "..."]
    assert shown
    return [line for line in shown if line not in done.splitlines()]


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
