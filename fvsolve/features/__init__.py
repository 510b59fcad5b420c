"""Features of models: a folder each, which the core finds by the header of its class and never names."""
