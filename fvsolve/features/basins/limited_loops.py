"""Loops of basins that take a limiter, in the form of `kernels.own_limiters.LOOPS`."""

HOME = "fvsolve.features.basins"
ADVECTION = f"{HOME}.advection"
LOOPS = {
    "faces_limited": (f"{HOME}.liquid.liquid_sides", "VVVV", ""),
    "faces_upwind_limited": (f"{HOME}.liquid.grid_nonlinear", "VVVVVVV", ""),
    "put_sloped": (f"{HOME}.free_surface.surface_rows", "iVVVV", ""),
    "put_sloped_at_kerbs": (f"{HOME}.free_surface.surface_rows", "iVVVV", ""),
    "put_slopes": (f"{HOME}.conduit.conduit_cells", "iV", ""),
    "put_face_values": (ADVECTION, "FtVVVVVV", ""),
    "single_face_value": (ADVECTION, "Fbtttt", "t"),
    "north_values_and_rates": (ADVECTION, "FtVtV4V3V3V", ""),
}
