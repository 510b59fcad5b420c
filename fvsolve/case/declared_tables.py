"""Tables of a case file that other folders and packages declare, such as `[report]`; only their headers are known.

@declared("case table", "report")
class ReportTable(Table): ...
"""

from typing import TYPE_CHECKING, Any, ClassVar

from fvsolve.declarations import Declarations
from fvsolve.parts.table_model import Table

if TYPE_CHECKING:
    from fvsolve.case.reading import Reading

# files with headers; a case without such tables reads none of them
DECLARED = Declarations("case table", "case tables", ("report/*_table.py", "features/*/*_table.py"))


class DeclaredTable(Table):
    """Table of a case file with keys of its own.

    changes_results : False if no key changes a number of a run, so that a checkpoint fits a case with other values
    """

    changes_results: ClassVar[bool] = True


def read_declared_tables(reading: "Reading", known: tuple[str, ...]) -> dict[str, Any]:
    """Tables of a case that headers declare : name -> `DeclaredTable`, without faulty tables.

    known : names of all other keys of a case
    """
    found = {}
    for name in reading.raw.table:
        if name not in known and name in DECLARED:
            table = reading.table(name, DECLARED.load(name))
            if table is not None:
                found[name] = table
    return found
