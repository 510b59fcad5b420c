"""Greatest stable step, predicted and measured, for cases and for periodic grids."""
