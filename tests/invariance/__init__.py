"""Invariance of results under equivalent descriptions of a case, and tests of single parts between any neighbours."""
