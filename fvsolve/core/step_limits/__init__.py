"""Greatest stable time steps of schemes and methods, computed before a run."""
