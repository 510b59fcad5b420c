"""Compiled functions of floats, arrays and codes. Knows no strings, no classes and no files."""
