"""`python -m fvsolve`."""

from fvsolve.cli import main

main()
