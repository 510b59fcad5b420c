"""Files and models of other programs, EPANET and FMU; may import `core`, `case` and `parts`."""
