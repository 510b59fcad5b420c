"""Features of models, which the core finds by headers and never names; may import `core`, `case` and `parts`."""
