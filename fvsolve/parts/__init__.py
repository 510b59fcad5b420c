"""Declarations of all types of parts: keys, units and valid ranges."""

from importlib import import_module
from pathlib import Path

from fvsolve.parts.basin.part import Basin
from fvsolve.parts.carried_scalar import Scalar
from fvsolve.parts.chamber.part import Chamber
from fvsolve.parts.cylinder.part import Cylinder
from fvsolve.parts.damper.part import Damper
from fvsolve.parts.end_stop.part import EndStop
from fvsolve.parts.force.part import Force
from fvsolve.parts.frame.part import Frame
from fvsolve.parts.friction_model import Friction
from fvsolve.parts.inflow.part import Inflow
from fvsolve.parts.junction.part import Junction
from fvsolve.parts.leak.part import Leak
from fvsolve.parts.link import Link
from fvsolve.parts.mass.part import Mass
from fvsolve.parts.node import Node
from fvsolve.parts.orifice.part import Orifice
from fvsolve.parts.pipe.part import Pipe
from fvsolve.parts.pipe.pipe_wall import Wall
from fvsolve.parts.plugins import declare_installed
from fvsolve.parts.reservoir.part import Reservoir
from fvsolve.parts.rigid_column.part import RigidColumn
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.spool_valve.part import EDGES, SpoolValve
from fvsolve.parts.spring.part import Spring
from fvsolve.parts.tank.part import AreaTable, Tank
from fvsolve.parts.torque.part import Torque
from fvsolve.parts.valve.part import Characteristic, Valve

for path in sorted(Path(__file__).parent.glob("*/part.py")):
    import_module(f"{__name__}.{path.parent.name}.part")

declare_installed()

KINDS = {"nodes": Node.kinds, "links": Link.kinds}

__all__ = [
    "EDGES", "KINDS", "AreaTable", "Basin", "Chamber", "Characteristic", "Cylinder", "Damper", "EndStop", "Force",
    "Frame", "Friction", "Inflow", "Junction", "Leak", "Link", "Mass", "Node", "Orifice", "Pipe", "Reservoir",
    "RigidColumn", "Scalar", "Schedule", "SpoolValve", "Spring", "Tank", "Torque", "Valve", "Wall",
]  # fmt: skip
