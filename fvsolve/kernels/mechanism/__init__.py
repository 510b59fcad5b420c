"""Bodies in space: joints, forces at points, the mass matrix. Loaded and compiled by scenes that have bodies alone."""
