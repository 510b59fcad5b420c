"""Entry point of `python -m fvsolve`."""

from fvsolve.cli import main

main()
