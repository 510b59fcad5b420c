"""Step limits of schemes and methods, computed before a run."""
