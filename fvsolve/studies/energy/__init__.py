"""Energy balance of runs, and passivity of schemes and methods."""
