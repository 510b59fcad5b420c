"""Basins: common parts, and a folder for each type of basin; loaded and compiled only for models with a basin."""
