"""The greatest step that does not fail, for cases and for grids without a case. Knows powers of a step."""
