"""Studies of accuracy: orders of convergence, and error against computing cost."""
