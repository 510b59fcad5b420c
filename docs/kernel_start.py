"""Start of the kernel of tutorials: a shell command that fails raises, and its output has no colours.

IPython itself ignores the exit status of `!COMMAND`.
"""

import os
import subprocess

from IPython import get_ipython


def system(command: str) -> None:
    """Run a shell command and print its output. Raises RuntimeError if it fails."""
    done = subprocess.run(
        command, shell=True, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    print(done.stdout, end="")
    if done.returncode:
        raise RuntimeError(f"exit status {done.returncode} of: {command}")


get_ipython().system = system
for name in ("FORCE_COLOR", "CLICOLOR_FORCE"):  # set by ipykernel
    os.environ.pop(name, None)
# figures are output of cells, in .ci/run too
os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
