"""Reference pages made from the program: commands with their options, units, public names with their docstrings."""

import ast
import inspect
import re
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import part_pages
from numba import from_dtype

import fvsolve
import fvsolve.steppers
import fvsolve.studies
from fvsolve.units import DIMENSIONS, NEAR_MISSES, UNITS, WORDS, Unit

PACKAGE = Path(fvsolve.__file__).parent
PYTHON_PAGE = (Path(__file__).parent / "python.md").read_text(encoding="utf-8")
# beginning of a line of a docstring about arguments or fields
ARGUMENT = re.compile(r"([^\s,]+(?:, [^\s,]+)*) : ")
CODE = re.compile(r"(`[^`]*`)")
MARK = re.compile(r"<!-- generated: (\S+)(?: (.+?))? -->\n")  # NAME, or NAME with words


def commands() -> str:
    """Sections of all commands: usage, purpose, arguments and options, from the application itself."""
    from typer.main import get_command

    from fvsolve.cli import application

    group = get_command(application())
    with group.context_class(group, info_name="fvsolve") as top:
        return "\n".join(
            command_section(group.get_command(top, name), name, top)
            for name in group.list_commands(top)
        )


def command_section(command, name: str, top) -> str:
    """Section of a command; `top` : context of the application."""
    with command.context_class(command, info_name=name, parent=top) as context:
        usage = " ".join(["fvsolve", name, *command.collect_usage_pieces(context)])
        records = filter(
            None, (one.get_help_record(context) for one in command.get_params(context))
        )
        rows = [(f"`{names}`", text) for names, text in records if names != "--help"]
    options = table(("argument or option", "meaning"), rows) if rows else ""
    return f"## fvsolve {name}\n\n```text\n{usage}\n```\n\n{prose(command.help)}\n\n{options}"


def units() -> str:
    """Tables of the quantities of a case file, with all their units, and of the spellings that are refused."""
    rows = {}  # by words, because some dimensions differ only in their use
    for name, one in DIMENSIONS.items():
        own = ", ".join(
            f"`{unit}` {size(found)}" for unit, found in UNITS.items() if found.dimension == name
        )
        as_other = ", ".join(
            filter(None, [f"those of {DIMENSIONS[one.base].words}" if one.base else "", own])
        )
        rows.setdefault(one.words, (one.words, f"`{one.si}`", f'`"{one.example}"`', as_other))
    words = [(f"`{word}`", f"`{symbol}`") for word, symbol in WORDS.items()]
    refused = [
        (f"`{given}`", f"`{proposal}`") for given, proposal in NEAR_MISSES.items() if proposal
    ]
    return (
        "## Units of each quantity\n\n"
        f"{table(('quantity', 'SI', 'example', 'units, with their size in SI'), rows.values())}\n"
        f"## Words, in small or capital letters\n\n{table(('word', 'unit'), words)}\n"
        f"## Spellings that are refused\n\n{table(('spelling', 'proposal of the message'), refused)}"
    )


def size(unit: Unit) -> str:
    """Size of a unit in SI; of a unit with an offset, the formula of a number in it."""
    factor = f"{unit.numerator / unit.denominator:.10g}"
    return (
        f"(number + {unit.offset:g}) × {factor}" if unit.offset else factor + " gauge" * unit.gauge
    )


def names() -> str:
    """Sections of all public names: those of `fvsolve`, and those of studies and of methods that python.md names."""
    said = {*re.findall(r"`(\w+)[`(]", PYTHON_PAGE)} - {*fvsolve.__all__}
    studies = sorted(said & {*fvsolve.studies.__all__})
    steppers = sorted((said & {*fvsolve.steppers.__all__}) - {*studies})
    modules = {"fvsolve": fvsolve.__all__, "fvsolve.studies": studies, "fvsolve.steppers": steppers}
    return "\n".join(
        f"## {module}\n\n" + "".join(entry(module, one) for one in all_)
        for module, all_ in modules.items()
    )


def entry(module: str, name: str) -> str:
    """Directive of a public name; a class contains its members that python.md names."""
    found, text = getattr(import_module(module), name), ""
    if not inspect.isclass(found):
        return directive(
            "function", f"{module}.{name}{arguments(found)}", docstring(found, f"{module}.{name}")
        )
    for member in dict.fromkeys(re.findall(r"[.`](\w+)", PYTHON_PAGE)):
        value = vars(found).get(member)
        kind = "method" if inspect.isfunction(value) else "property"
        if inspect.isfunction(value) or isinstance(value, property) or hasattr(value, "func"):
            head = member + (arguments(value) if kind == "method" else "")
            text += directive(kind, head, docstring(value, f"{name}.{member}"))
    kind = "exception" if issubclass(found, Exception) else "class"
    return directive(
        kind, f"{module}.{name}", f"{docstring(found, f'{module}.{name}')}\n\n{text}", "::::"
    )


def directive(kind: str, head: str, text: str, fence: str = ":::") -> str:
    return f"{fence}{{py:{kind}}} {head}\n{text}\n{fence}\n\n"


def arguments(found) -> str:
    """Arguments of a function with their default values, without types and without `self`."""
    given = inspect.signature(found)
    kept = [
        one.replace(annotation=one.empty) for key, one in given.parameters.items() if key != "self"
    ]
    return str(given.replace(parameters=kept, return_annotation=given.empty))


def docstring(found, name: str) -> str:
    """Docstring as Markdown. Raises ValueError for a public name without docstring."""
    if not (text := inspect.getdoc(found)):
        raise ValueError(
            f"{name} has no docstring; expected a sentence, because the site lists all public names"
        )
    return prose(text)


def prose(text: str) -> str:
    """Text of a docstring as Markdown. A line `NAME : TEXT` begins an item of a list."""
    lines: list[str] = []
    inside = False
    for line in inspect.cleandoc(text).splitlines():
        if found := ARGUMENT.match(line):
            line = f"{'' if inside else chr(10)}- {found[1]}: {line[found.end() :]}"
        elif inside and line:
            line = f"\n{line}" if line[0].isupper() else f"  {line}"
        inside = line.lstrip("\n").startswith(("- ", "  "))
        lines.append(line)
    return escaped("\n".join(lines))


def escaped(text: str) -> str:
    """Text in which characters with a meaning in Markdown, outside of code, stand for themselves."""
    return "".join(
        one if one.startswith("`") else re.sub(r"[*<$|]", r"\\\g<0>", one)
        for one in CODE.split(text)
    )


def table(head, rows) -> str:
    """Markdown table."""
    lines = (
        " | ".join(escaped(cell) for cell in cells) for cells in (head, ("---",) * len(head), *rows)
    )
    return "".join(f"| {line} |\n" for line in lines)


def tables() -> str:
    """Sections of all tables of a model, by the feature that owns them: columns with types and meanings."""
    sections = ""
    for path in sorted(PACKAGE.rglob("*.py"), key=lambda path: ("core" not in path.parts, path)):
        text = path.read_text(encoding="utf-8")
        if not (records := list(records_in(text))):
            continue
        place = path.relative_to(PACKAGE)
        names = table_names(import_module(".".join(("fvsolve", *place.with_suffix("").parts))))
        owner = "the core" if place.parts[0] == "core" else place.parts[1].replace("_", " ")
        sections += f"## Tables of {owner}\n\n`fvsolve/{place.as_posix()}`\n\n"
        for name, about, columns in records:
            rows = table(("column", "type", "meaning"), column_rows(text, name, columns))
            place_of_rows = f"`tables.{names[name]}[i]`" if name in names else ""
            head = "\n\n".join(filter(None, [place_of_rows, escaped(about)]))
            sections += f"### {name}\n\n{head}\n\n{rows}\n"
        if arrays := [(f"`tables.{name}`", about) for name, about in arrays_in(text)]:
            sections += f"### Arrays of numbers\n\n{table(('array', 'contents'), arrays)}\n"
    return sections


def column_rows(text: str, name: str, columns: list[ast.keyword]) -> Iterator[tuple[str, str, str]]:
    """Yield the rows of the table of a record type: column, type, meaning."""
    lines = text.splitlines()
    for column in columns:
        row = column.value.end_lineno - 1
        # a record in one line has only its own
        own = "" if lines[row].startswith(name) else comment(lines, row)
        yield f"`{column.arg}`", type_of(column.value), own


def hooks() -> str:
    """Table of the functions of the law of a part, from their declarations."""
    from fvsolve.core.kernels.calls import HOOKS

    rows = [
        (f"`{name}({hook.names})`", hook.when, hook.results, hook.about)
        for name, hook in HOOKS.items()
    ]
    return table(("function", "called", "result", "reads and writes"), rows)


def table_names(module) -> dict[str, str]:
    """Names by which compiled functions read the tables of a module : record type -> table."""
    types = [
        one()
        for key, one in vars(module).items()
        if key.endswith("_types") and one.__module__ == module.__name__
    ]
    records = {name: one for name, one in vars(module).items() if getattr(one, "names", None)}
    return {
        name: table
        for name, one in records.items()
        for fields in types
        for table, kind in fields._asdict().items()
        if kind.dtype == from_dtype(one)
    }


def arrays_in(text: str) -> Iterator[tuple[str, str]]:
    """Yield the arrays of numbers that a text of Python names in `Tables` and `RunArrays`: name, its comment."""
    lines = text.splitlines()
    for found in ast.parse(text).body:
        if isinstance(found, ast.Assign) and ast.unparse(found.targets[0]) in (
            "Tables",
            "RunArrays",
        ):
            for one in found.value.args[1].elts:
                if isinstance(one, ast.Constant):
                    yield one.value, comment(lines, one.lineno - 1)


def records_in(text: str) -> Iterator[tuple[str, str, list[ast.keyword]]]:
    """Yield the record types in a text of Python: name, its comment, columns as arguments of `record`."""
    if "= record(" not in text:
        return
    for found in ast.parse(text).body:
        call = found.value if isinstance(found, ast.Assign) else None
        if (
            isinstance(call, ast.Call)
            and isinstance(call.func, ast.Name)
            and call.func.id == "record"
        ):
            yield found.targets[0].id, comment(text.splitlines(), found.lineno - 1), call.keywords


def type_of(value: ast.expr) -> str:
    """Type of a column in words; a text such as "(3,)f8" stands for itself."""
    kind = value.value if isinstance(value, ast.Constant) else value.id
    return {"i8": "integer", "f8": "number"}.get(kind, f"`{kind}`")


def comment(lines: list[str], row: int) -> str:
    """Comment at the end of a line of code, else in the lines above it; "" without one."""
    if own := lines[row].partition("  # ")[2].strip():
        return own
    first = row
    while first > 0 and lines[first - 1].lstrip().startswith("# "):
        first -= 1
    return " ".join(line.lstrip(" #").rstrip() for line in lines[first:row])


def validation() -> str:
    """Page that `fvsolve validate --page docs/validation/results` has written, with paths from the folder above it."""
    folder = Path(__file__).parent / "validation" / "results"
    if not (folder / "index.md").is_file():
        return "This build has no results. `fvsolve validate --data DIR --page docs/validation/results` makes them.\n"
    text = (folder / "index.md").read_text(encoding="utf-8").partition("\n")[2]
    return re.sub(r"(?<=\]\()([\w-]+\.png)", r"results/\1", text)


def names_of_practice() -> str:
    """Table of the names of practice with the pages of their parts, and their examples."""
    from fvsolve.case import part_names

    types, places = part_names.part_types(), part_pages.page_of_types()
    rows, examples = [], ""
    for one in part_names.names_of_practice():
        links = (f"[{kind}](parts/{places[kind]})" for kind in one.parts)
        parts = (" and " if one.composed else " or ").join(links)
        rows.append((", ".join(one.names), parts, one.about))
        if one.example != types[one.parts[0]].example:
            examples += f"### {one.names[0]}\n\n{escaped(one.about)}\n\n{toml(one)}"
    head = ("names", "parts", "meaning")
    return f"## Names\n\n{table(head, rows)}\n## Examples of names\n\n{examples}"


def toml(entry) -> str:
    """Example of a part as a block of TOML."""
    return f"```toml\n{entry.example}\n```\n\n"


# shipped cases that can be turned by hand: time of the frame
VIEWS = {"flooding": "40 s", "tanker-braking": "3 s"}


def views() -> str:
    """Frames of `VIEWS` as pages beside this file, each in a window that can be turned; runs the cases."""
    folder, text = Path(__file__).parent / "views", ""
    folder.mkdir(exist_ok=True)
    for name, time in VIEWS.items():
        result = fvsolve.run(name, out=folder / "runs" / name, force=True, pictures=False)
        page = result.view(time=float(time.split()[0]), path=folder / f"{name}.html")
        text += f'<iframe class="view" src="_static/{page.name}" title="{name} after {time}" loading="lazy"></iframe>\n'
    shutil.rmtree(folder / "runs")
    return f"```{{raw}} html\n{text}```\n"


GENERATED = {
    "commands": commands,
    "units": units,
    "names": names,
    "tables": tables,
    "hooks": hooks,
    "names_of_practice": names_of_practice,
    "validation": validation,
    "views": views,
    "part": part_pages.part,
    "keys": part_pages.keys,
    "part_index": part_pages.part_index,
}


def filled(text: str) -> str:
    """Text of a page with its marks `<!-- generated: NAME -->`, or NAME and words, replaced by what they name."""
    return MARK.sub(lambda mark: GENERATED[mark[1]](*(mark[2] or "").split()), text)


if __name__ == "__main__":
    print(GENERATED[sys.argv[1]](*sys.argv[2:]))
