"""Fields in the plane; loaded and compiled by scenes with basins alone."""
