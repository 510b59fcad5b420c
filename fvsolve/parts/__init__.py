"""Declarations of all types of parts: keys, units and valid ranges."""

from importlib import import_module
from pathlib import Path

from fvsolve.parts.basin import Basin
from fvsolve.parts.body_links import Torque
from fvsolve.parts.carried_scalar import Scalar
from fvsolve.parts.conduit import Friction
from fvsolve.parts.cylinder import Cylinder
from fvsolve.parts.hydraulic_nodes import Chamber, Inflow, Junction, Reservoir
from fvsolve.parts.nodes_and_links import Link, Node
from fvsolve.parts.outlet.part import Leak
from fvsolve.parts.pipe.part import Pipe
from fvsolve.parts.pipe.pipe_wall import Wall
from fvsolve.parts.plugins import declare_installed
from fvsolve.parts.rigid_column import RigidColumn
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.spool_valve.part import SpoolValve
from fvsolve.parts.tank import AreaTable, Tank
from fvsolve.parts.translational import Damper, EndStop, Force, Frame, Mass, Spring
from fvsolve.parts.valve import Characteristic, Orifice, Valve

package = Path(__file__).parents[1]
for pattern in ("parts/[a-z]*.py", "parts/*/part.py", "basins/*/part.py"):  # the last declares types of basins
    for path in sorted(package.glob(pattern)):
        import_module(".".join((package.name, *path.relative_to(package).with_suffix("").parts)))

declare_installed()

KINDS = {"nodes": Node.kinds, "links": Link.kinds}

__all__ = [
    "KINDS", "AreaTable", "Basin", "Chamber", "Characteristic", "Cylinder", "Damper", "EndStop", "Force",
    "Frame", "Friction", "Inflow", "Junction", "Leak", "Link", "Mass", "Node", "Orifice", "Pipe", "Reservoir",
    "RigidColumn", "Scalar", "Schedule", "SpoolValve", "Spring", "Tank", "Torque", "Valve", "Wall",
]  # fmt: skip
