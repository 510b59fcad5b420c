"""What becomes of runs, square by square. Knows runs; predicts only what eigenvalues say."""
