"""Pictures of cases and runs; the only package that imports matplotlib and PyVista."""
