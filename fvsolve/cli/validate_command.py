"""`fvsolve validate`: cases beside measurements, published results and exact solutions."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from fvsolve.cli.app import Jobs, Json, announce_compilation, command
from fvsolve.cli.terminal import present
from fvsolve.core.output.result_table import ResultTable

STYLES = {"within": "green", "outside": "bold red"}


@command("validate", order=310)
def validate(
    names: Annotated[
        list[str] | None,
        Argument(
            metavar="[NAME]...",
            help="names of shipped validations, or case files "
            "with a table [validation] (default all shipped validations)",
        ),
    ] = None,
    data: Annotated[
        Path | None, Option(metavar="DIR", help="folder with the files of measurements")
    ] = None,
    page: Annotated[
        Path | None,
        Option(metavar="DIR", help="folder of a page with a table and a figure of each case"),
    ] = None,
    out: Annotated[
        Path | None,
        Option(
            metavar="DIR",
            help="folder in which the case files, tables and copies of data "
            "are kept (default none are kept)",
        ),
    ] = None,
    list_names: Annotated[
        bool, Option("--list", help="list the validations and the files that they need")
    ] = False,
    jobs: Jobs = 1,
    as_json: Json = False,
) -> None:
    """Compare cases with measurements, published results and exact solutions."""
    from fvsolve.studies.validation import library
    from fvsolve.studies.validation.page import write_page

    if list_names:
        return present(as_json, *listed(library.find(names or [])))
    announce_compilation()
    results = []
    for result in library.validate(names or [], data, jobs, out):
        print(
            f"{result.name}: {result.verdict}, {result.seconds:.1f} s", file=sys.stderr, flush=True
        )
        results.append(result)
    results.sort(key=lambda result: result.name)
    code = library.exit_code(results)
    if page is not None:
        write_page(page, results)
    plain = {"exit_code": code, "validations": [result.plain() for result in results]}
    present(as_json, plain, result_text(results), code)


def listed(paths: dict[str, Path]) -> tuple[dict, list]:
    """Validations with title and files, as plain data and as a table."""
    from fvsolve.case.reading import read_raw
    from fvsolve.studies.validation import library

    raws = {name: read_raw(path) for name, path in paths.items()}
    tables = {name: library.read_table(raw) for name, raw in raws.items()}
    plain = {
        name: {
            "title": raws[name].table.get("title", ""),
            "source": table.source,
            "licence": table.licence,
            "files": table.files,
            "get": table.get,
        }
        for name, table in tables.items()
    }
    rows = [[name, item["title"], ", ".join(item["files"]) or "-"] for name, item in plain.items()]
    return plain, [ResultTable.of("", ["validation", "title", "files of --data"], rows)]


def result_text(results: list) -> Iterator:
    """Table of all rows, then the reasons, and the data that lack."""
    from fvsolve.studies.validation.row_texts import amounts

    rows = []
    for result in results:
        for row in result.rows:
            texts = amounts(row)
            cells = texts.reference, texts.value, texts.error, texts.others
            rows.append([result.name, row.row.what, *cells, row.unit, row.verdict])
    if rows:
        yield ResultTable.of(
            "",
            ["case", "quantity", "measured", "computed", "error", "others", "unit", "verdict"],
            rows,
        )
    for result in results:
        for row in result.rows:
            if row.text:
                yield (
                    f"{result.name}, {row.row.what}: {row.verdict}: {row.text}",
                    STYLES.get(row.verdict, "yellow"),
                )
        if result.fault:
            yield f"{result.name}: {result.fault}", "bold red"
        for text in result.lacking:
            yield f"{result.name}: {text}", "bold red"
        if result.lacking:
            where = result.validation.get or "see the source of the case"
            yield f"{result.name}: how to get the files: {where}; then --data DIR"
    counts = {
        verdict: sum(result.verdict == verdict for result in results)
        for verdict in dict.fromkeys(result.verdict for result in results)
    }
    seconds = sum(result.seconds for result in results)
    yield f"{len(results)} cases: {', '.join(f'{n} {verdict}' for verdict, n in counts.items())}; {seconds:.1f} s"
