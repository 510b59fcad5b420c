"""Whether ports are passive: positive real functions, exactly or by a sweep. Knows transfer functions."""
