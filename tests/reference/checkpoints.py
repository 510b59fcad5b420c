"""Checkpoints that a test changes, with the digest of their arrays as a run writes it."""

import numpy as np

from fvsolve.core.output.restart import SEAL, digest_of


def write_sealed(path, arrays) -> None:
    """Write the arrays of a checkpoint with their digest."""
    arrays = {key: np.asarray(array) for key, array in arrays.items() if key != SEAL}
    np.savez(path, **arrays, **{SEAL: np.array(digest_of(arrays))})
