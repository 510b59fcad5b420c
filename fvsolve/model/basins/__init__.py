"""Basins lowered to rows of tables: one module for each physics."""

from fvsolve.model.basins.basin import Basin, at_start, lower_basins
from fvsolve.model.basins.free_surface import FreeSurface
from fvsolve.model.basins.liquid import Liquid

__all__ = ["Basin", "FreeSurface", "Liquid", "at_start", "lower_basins"]
