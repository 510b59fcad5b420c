"""A case about a state: A, B, C, D and their spectrum. Knows derivatives; judges nothing."""
