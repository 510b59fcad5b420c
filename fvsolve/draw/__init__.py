"""Pictures of runs; the only package that imports matplotlib and PyVista."""
