"""What a user may declare, one file per part. Knows units and ranges; does no arithmetic."""

from fvsolve.parts.chamber import Chamber
from fvsolve.parts.friction import Friction
from fvsolve.parts.inflow import Inflow
from fvsolve.parts.junction import Junction
from fvsolve.parts.link import Link
from fvsolve.parts.node import Node
from fvsolve.parts.orifice import Orifice
from fvsolve.parts.pipe import Pipe, Wall
from fvsolve.parts.reservoir import Reservoir
from fvsolve.parts.rigid_column import RigidColumn
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.tank import AreaTable, Tank
from fvsolve.parts.valve import Characteristic, Valve

KINDS = {"nodes": Node.kinds, "links": Link.kinds}

__all__ = [
    "KINDS", "AreaTable", "Chamber", "Characteristic", "Friction", "Inflow", "Junction", "Link", "Node",
    "Orifice", "Pipe", "Reservoir", "RigidColumn", "Schedule", "Tank", "Valve", "Wall",
]  # fmt: skip
