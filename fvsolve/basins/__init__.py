"""Basins: common parts and a folder for each physics, loaded and compiled only for models that contain a basin."""
