"""Basins: common parts, and a folder for each type of basin; loaded and compiled only for models with a basin."""

from pathlib import Path

from fvsolve.features import scalars
from fvsolve.jit import add_sources

FOLDER = Path(__file__).parent
# of files without compiled functions
UNCOMPILED_PREFIXES = (
    "part",
    "lower",
    "feature",
    "pattern",
    "accounts",
    "facts",
    "held",
    "__init__",
)
COMPILED = [
    path for path in sorted(FOLDER.rglob("*.py")) if not path.name.startswith(UNCOMPILED_PREFIXES)
]

# functions of basins call those of scalars
add_sources(
    FOLDER,
    *(str(path.relative_to(FOLDER)) for path in COMPILED),
    called=[Path(scalars.__file__).parent],
)
