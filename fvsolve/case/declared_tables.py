"""Tables of a case file that other folders and packages declare, such as `[report]`; only their headers are known.

@declared("case table", "report")
class ReportTable(Table): ...
"""

from typing import Any, ClassVar

from fvsolve.declarations import Declarations
from fvsolve.parts.table_model import Table

# tables and keys of a case that no other folder declares
KEYS = (
    "schema",
    "title",
    "description",
    "source",
    "ambient_pressure",
    "gravity",
    "fluid",
    "nodes",
    "links",
    "signals",
    "controls",
    "scalars",
    "reactions",
    "defaults",
    "numerics",
    "output",
    "energy",
    "expect",
    "compare",
    "routes",
    "limits",
    "exact",
    "validation",
)
# files with headers; a case without such tables reads none of them
DECLARED = Declarations(
    "case table",
    "case tables",
    ("report/*_table.py", "features/*/*_table.py", "exchange/*/*_table.py"),
)


class DeclaredTable(Table):
    """Table of a case file with keys of its own.

    changes_results : False if no key changes a number of a run, so that a checkpoint fits a case with other values
    """

    changes_results: ClassVar[bool] = True

    @classmethod
    def add_parts(cls, raw: Any) -> list[tuple[tuple[Any, ...], str]]:
        """Write the parts that the table stands for into a raw case; returns faults (key path, text)."""
        return []


def add_declared_parts(raw: Any) -> list[tuple[tuple[Any, ...], str]]:
    """Write the parts that tables of other folders stand for into a raw case; returns faults as (key path, text)."""
    names = [name for name in raw.table if is_declared(name)]
    return [fault for name in names for fault in DECLARED.load(name).add_parts(raw)]


def is_declared(name: str) -> bool:
    """True for the name of a table that another folder or package declares."""
    return name not in KEYS and name in DECLARED


def read_declared_tables(reading: Any) -> dict[str, Any]:
    """Tables of a case that headers declare : name -> `DeclaredTable`, without faulty tables."""
    found = {}
    for name in reading.raw.table:
        if is_declared(name):
            table = reading.table(name, DECLARED.load(name))
            if table is not None:
                found[name] = table
    return found
