"""Basins lowered to rows of tables: one module for each physics."""

from fvsolve.model.basins.basin import Basin, at_start, lower_basins
from fvsolve.model.basins.free_surface import FreeSurface
from fvsolve.model.basins.liquid import Liquid
from fvsolve.model.basins.transport import Transport

__all__ = ["Basin", "FreeSurface", "Liquid", "Transport", "at_start", "lower_basins"]
