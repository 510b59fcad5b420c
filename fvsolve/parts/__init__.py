"""What a user may declare, one file per part. Knows units and ranges; does no arithmetic."""

from importlib import import_module
from pathlib import Path

from fvsolve.parts.basin import Basin
from fvsolve.parts.chamber import Chamber
from fvsolve.parts.cylinder import Cylinder
from fvsolve.parts.damper import Damper
from fvsolve.parts.end_stop import EndStop
from fvsolve.parts.force import Force
from fvsolve.parts.frame import Frame
from fvsolve.parts.friction import Friction
from fvsolve.parts.inflow import Inflow
from fvsolve.parts.junction import Junction
from fvsolve.parts.leak import Leak
from fvsolve.parts.link import Link
from fvsolve.parts.mass import Mass
from fvsolve.parts.node import Node
from fvsolve.parts.orifice import Orifice
from fvsolve.parts.outside import declare_offered
from fvsolve.parts.pipe import Pipe, Wall
from fvsolve.parts.reservoir import Reservoir
from fvsolve.parts.rigid_column import RigidColumn
from fvsolve.parts.scalar import Scalar
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.spool_valve import EDGES, SpoolValve
from fvsolve.parts.spring import Spring
from fvsolve.parts.tank import AreaTable, Tank
from fvsolve.parts.torque import Torque
from fvsolve.parts.valve import Characteristic, Valve

for path in sorted(Path(__file__).parent.glob("*/part.py")):
    import_module(f"{__name__}.{path.parent.name}.part")

declare_offered()

KINDS = {"nodes": Node.kinds, "links": Link.kinds}

__all__ = [
    "EDGES", "KINDS", "AreaTable", "Basin", "Chamber", "Characteristic", "Cylinder", "Damper", "EndStop", "Force",
    "Frame", "Friction", "Inflow", "Junction", "Leak", "Link", "Mass", "Node", "Orifice", "Pipe", "Reservoir",
    "RigidColumn", "Scalar", "Schedule", "SpoolValve", "Spring", "Tank", "Torque", "Valve", "Wall",
]  # fmt: skip
