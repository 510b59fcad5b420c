"""Keys of the table `[gis]` of a case: its reference system, and layers of GIS files that become parts of the case."""

from typing import Annotated, Any, ClassVar

from fvsolve.case.declared_tables import DeclaredTable
from fvsolve.declarations import declared
from fvsolve.exchange.gis.layer_keys import GisLayer
from fvsolve.parts.basin import ORIGIN, ReferenceSystem
from fvsolve.parts.table_model import NamedTables


@declared("case table", "gis")
class GisTable(DeclaredTable):
    """Table `[gis]`: reference system of the case, and layers of GIS files that become parts."""

    changes_results: ClassVar[bool] = False  # its layers are replaced by their parts

    crs: Annotated[
        str | None,
        ReferenceSystem(
            "coordinate reference system of the case; that of its basins, or of the first file, if left out"
        ),
    ] = None
    origin: Annotated[tuple[float, float] | None, ORIGIN] = None
    layers: Annotated[
        dict[str, GisLayer],
        NamedTables(GisLayer, "layers: { pipes = { file, becomes, name, keys } }"),
    ] = {}

    @classmethod
    def add_parts(cls, raw: Any) -> list[tuple[tuple[Any, ...], str]]:
        """Replace the layers in a raw case by their parts; returns faults as (key path, text)."""
        from fvsolve.exchange.gis.layer_parts import add_layers

        return add_layers(raw, cls)
