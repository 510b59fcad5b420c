"""Properties of a Butcher array: order, stability, Pade approximation."""
