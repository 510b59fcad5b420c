"""Entry point of `python -m fvsolve`."""

from fvsolve.compile.child_process import forget_present_folder

forget_present_folder()

from fvsolve.cli import main  # noqa: E402

main()
