"""Codes by which compiled functions of a physics recognise its basins."""

from zlib import crc32


def physics_code(package: str) -> int:
    """Code of the physics of a package: each of its compiled files contains `OWN_CODE = physics_code(__package__)`."""
    return crc32(package.encode())
