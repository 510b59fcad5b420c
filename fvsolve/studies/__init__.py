"""Studies of a case by many runs: order, cost, stability, energy, sizing, sweeps; may import all but report and cli.

A public function or class has the header `@declared("study")`. It is found by the text of its module, and imported on
first use. Studies of other packages are found by their entry points.
"""

from fvsolve.declarations import Declarations
from fvsolve.lazy_exports import lazy_attributes

STUDIES = Declarations(
    "study", "studies", ("studies/**/*.py", "core/step_limits/advection_limit.py")
)

lazy_attributes(__name__, STUDIES, STUDIES.load)
