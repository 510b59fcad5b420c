"""The code by which compiled functions of a physics know its basins. Knows folders; knows no physics."""

from zlib import crc32


def kind_of(package: str) -> int:
    """Code of the physics whose folder is that package: in each of its compiled files `MINE = kind_of(__package__)`."""
    return crc32(package.encode())
