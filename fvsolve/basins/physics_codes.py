"""Codes by which compiled functions of a type of basin recognise its basins."""

from zlib import crc32


def physics_code(package: str) -> int:
    """Code of the type of basin in a package; its compiled files contain `OWN_CODE = physics_code(__package__)`."""
    return crc32(package.encode())
