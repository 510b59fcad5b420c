"""Cases and templates that are shipped with the package: folder, names, paths, titles, copies."""

import shutil
import tomllib
from collections.abc import Callable
from filecmp import cmp
from pathlib import Path
from typing import Any

from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.file_replacement import replacing, write_file

SCHEMA = "schema.json"  # file beside the cases; editors use it for completion and checks
STUDY = "-study"  # end of the name of the study of a template


def folder() -> Path:
    """Folder of the shipped cases: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "cases"
    return inside if inside.is_dir() else package.parent / "cases"


def names() -> list[str]:
    """Names of the shipped cases, sorted."""
    return sorted(path.stem for path in folder().glob("*.toml"))


def templates() -> list[str]:
    """Names of the templates, sorted; a template is a case with comments for changes, and may have a study."""
    paths = (folder() / "templates").glob("*.toml")
    return sorted(path.stem for path in paths if not path.stem.endswith(STUDY))


def copy_template(name: str, to: Path) -> list[Path]:
    """Write a template to the file `to`, and its study to the file of that name with "-study"; returns the paths.

    `to` may also be a folder. The study names the written case. The schema of case files is copied too, if it is not
    there. Raises FvsolveError for an unknown template, and if one of the files exists.
    """
    if name not in templates():
        raise FvsolveError(
            f"no template {name}{did_you_mean(name, templates())}; templates are {listing(templates())}"
        )
    to = to / f"{name}.toml" if to.is_dir() else to
    texts = {}
    for end in ("", STUDY):
        source = folder() / "templates" / f"{name}{end}.toml"
        if source.is_file():
            text = source.read_text(encoding="utf-8")
            text = text.replace(f"{name}{STUDY}", f"{to.stem}{STUDY}")
            texts[to.with_name(f"{to.stem}{end}{to.suffix}")] = text.replace(
                f'"{name}.toml"', f'"{to.name}"'
            )
    for path in texts:
        if path.exists():
            raise FvsolveError(
                f"{path} exists; give another file: fvsolve new --template {name} FILE"
            )
    to.parent.mkdir(parents=True, exist_ok=True)
    for path, text in texts.items():
        write_file(path, text)
    schema = to.parent / SCHEMA
    if (folder() / SCHEMA).is_file() and not schema.exists():
        with replacing(schema) as fresh:
            shutil.copyfile(folder() / SCHEMA, fresh)
    return [*texts]


def find(name: str) -> Path:
    """Path of an existing file, or of the shipped case of that name. Raises FvsolveError if there is neither."""
    path = Path(name)
    if path.is_file():
        return path
    if name in names():  # even if the working folder has a folder of that name
        return folder() / f"{name}.toml"
    if path.is_dir():
        raise FvsolveError(
            f"{name} is a folder; expected a case file or one of: {listing(names())}"
        )
    raise FvsolveError(
        f"no file and no shipped case {name}{did_you_mean(name, names())}; see `fvsolve list`"
    )


def titles() -> dict[str, str]:
    """Title of every shipped case by name."""
    result = {}
    for name in names():
        with open(folder() / f"{name}.toml", "rb") as file:
            result[name] = tomllib.load(file).get("title", "")
    return result


def copy(name: str, to: Path, load: Callable[[Path], Any]) -> list[Path]:
    """Copy a shipped case to the file `to`, and its other files beside it; returns the paths of the copies.

    `to` may also be a folder; load : function that reads a case. The schema of case files is copied too, if it is not
    there. Raises FvsolveError for an unknown case, if `to` exists, and if another of these files exists with other
    contents.
    """
    if name not in names():
        raise FvsolveError(
            f"no shipped case {name}{did_you_mean(name, names())}; cases are {listing(names())}"
        )
    if to.is_dir():
        to = to / f"{name}.toml"
    source = folder() / f"{name}.toml"
    pairs = [(source, to)]
    pairs += [
        (Path(path), to.parent / Path(path).absolute().relative_to(folder()))
        for path in load(source).files
    ]
    schema = to.parent / SCHEMA
    pairs = pairs[:1] + [
        pair for pair in pairs[1:] if not (pair[1].is_file() and cmp(*pair, shallow=False))
    ]
    for _, target in pairs:
        if target.exists():
            raise FvsolveError(f"{target} exists; give another file: fvsolve new {name} FILE")
    if (folder() / SCHEMA).is_file() and not schema.exists():
        pairs.append((folder() / SCHEMA, schema))
    for path, target in pairs:
        target.parent.mkdir(parents=True, exist_ok=True)
        with replacing(target) as fresh:
            shutil.copyfile(path, fresh)
    return [target for _, target in pairs]
