"""Keys of the table `[report]` of a case: words of a report, decimal sign of its numbers, and classes of its maps."""

import base64
import datetime
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from fvsolve.case.declared_tables import DeclaredTable
from fvsolve.declarations import declared
from fvsolve.parts.csv_rows import copy_name, find_file
from fvsolve.parts.value import (
    VALUE,
    Choice,
    Quantity,
    ReadContext,
    Rows,
    Text,
    Value,
    nonnegative,
    positive,
)
from fvsolve.units import show

# suffix of a picture -> its media type
PICTURES = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".svg": "image/svg+xml",
    ".webp": "image/webp",
}
MAX_LOGO = 1_000_000  # greatest size of a logo [bytes]
MAX_TEXT = 200_000  # greatest number of letters of a text


@dataclass(frozen=True)
class ReportDate(Value):
    """Value of a case file: a date of TOML, or text such as "March 2026"."""

    about: str = ""
    changes: str = VALUE
    takes: ClassVar[str] = "date or text"
    schema: ClassVar[dict[str, Any]] = {"type": "string"}

    def read(self, given: Any, setting: ReadContext) -> str:
        if isinstance(given, datetime.datetime):
            return given.isoformat(" ", "minutes")
        if isinstance(given, datetime.date):
            return given.isoformat()
        if not isinstance(given, str):
            raise ValueError(f"{show(given)} is not a date; expected for example 2026-03-01")
        return given


@dataclass(frozen=True)
class Logo(Value):
    """Value of a case file: path of a picture; as read, the name of its copy in the run directory."""

    about: str = ""
    changes: str = VALUE
    takes: ClassVar[str] = "path"
    schema: ClassVar[dict[str, Any]] = {"type": "string"}

    def read(self, given: Any, setting: ReadContext) -> str:
        path = find_file(Text().read(given, setting), setting)
        if path.suffix.lower() not in PICTURES:
            raise ValueError(f"{show(given)} is not a picture; expected {', '.join(PICTURES)}")
        if (size := path.stat().st_size) > MAX_LOGO:
            raise ValueError(
                f"{show(given)} has {size / 1e6:.1f} MB; expected a picture of at most {MAX_LOGO / 1e6:g} MB"
            )
        return copy_name(path, setting)


@dataclass(frozen=True)
class MarkdownText(Value):
    """Value of a case file: text in Markdown, or `{ file = "scope.md" }` with the text."""

    about: str = ""
    changes: str = VALUE
    takes: ClassVar[str] = 'text, or { file = "scope.md" }'
    schema: ClassVar[dict[str, Any]] = {"type": ["string", "object"]}

    def read(self, given: Any, setting: ReadContext) -> str:
        text = given
        if isinstance(given, dict):
            if list(given) != ["file"]:
                raise ValueError(f'{show(given)}: expected text, or {{ file = "scope.md" }}')
            path = find_file(Text().read(given["file"], setting), setting)
            try:
                text = path.read_text(encoding="utf-8-sig")
            except (OSError, UnicodeDecodeError) as error:
                raise ValueError(f"{show(given['file'])} is not a text in UTF-8: {error}") from None
        if not isinstance(text, str):
            raise ValueError(f"{show(given)} is not text; expected text in quotes")
        if len(text) > MAX_TEXT:
            raise ValueError(f"the text has {len(text)} letters; expected at most {MAX_TEXT}")
        return text


def _classes(dimension: str, words: str, example: str) -> Rows:
    about = f"lower limits of the classes of {words} on maps, ascending, such as {example}"
    return Rows(dimension, nonnegative, rising=True, about=about, changes=VALUE)


@declared("case table", "report")
class ReportTable(DeclaredTable):
    """Table `[report]`: words and choices for the report of a run; it changes no result."""

    changes_results: ClassVar[bool] = False

    client: Annotated[str, Text("name of the client", VALUE)] = ""
    project: Annotated[str, Text("name of the project", VALUE)] = ""
    number: Annotated[str, Text("number of the project or report", VALUE)] = ""
    revision: Annotated[str, Text("revision of the report", VALUE)] = ""
    author: Annotated[str, Text("author of the report", VALUE)] = ""
    date: Annotated[str, ReportDate("date of the report")] = ""
    logo: Annotated[str, Logo("picture at the top: .png, .jpg, .svg or .webp, at most 1 MB")] = ""
    before: Annotated[str, MarkdownText("text below the title, in Markdown")] = ""
    after: Annotated[str, MarkdownText("text at the end, in Markdown")] = ""
    decimal: Annotated[
        str, Choice("decimal sign", ("point", "comma"), "decimal sign of numbers", changes=VALUE)
    ] = "point"
    least_depth: Annotated[
        float,
        Quantity("level", positive, "depth below which maps show no water [m]", changes=VALUE),
    ] = 0.01
    depth_classes: Annotated[
        tuple[float, ...] | None, _classes("level", "depth", '["0.05 m", "0.1 m", "0.5 m"]')
    ] = None
    speed_classes: Annotated[
        tuple[float, ...] | None, _classes("velocity", "speed", '[0, "0.5 m/s", "1 m/s"]')
    ] = None
    hazard_classes: Annotated[
        tuple[float, ...] | None,
        _classes("unit_flow", "depth times speed", '[0, "0.3 m2/s", "1 m2/s"]'),
    ] = None

    def table(self) -> dict[str, Any]:
        """Keys and values as in a case file, without empty texts."""
        return {key: value for key, value in super().table().items() if value != ""}

    @property
    def facts(self) -> list[tuple[str, str]]:
        """Pairs of a word and its text for the title block, without empty texts."""
        words = ("client", "project", "number", "revision", "author", "date")
        return [(word, getattr(self, word)) for word in words if getattr(self, word)]


def report_table(case: Any) -> ReportTable:
    """Table `[report]` of a case; without it, one with default values."""
    return case.declared.get("report") or ReportTable.model_validate({}, context=ReadContext())


def picture_address(folder: Path | None, name: str) -> str:
    """Address `data:` of a picture in a folder, which needs no file or network; "" if there is no such file."""
    path = (folder or Path()) / name
    if not name or not path.is_file():
        return ""
    content = base64.b64encode(path.read_bytes()).decode()
    return f"data:{PICTURES[path.suffix.lower()]};base64,{content}"
