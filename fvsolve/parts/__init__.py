"""What a user may declare, one file per part. Knows units and ranges; does no arithmetic."""

from fvsolve.parts.accumulator import Accumulator
from fvsolve.parts.air_valve import AirValve
from fvsolve.parts.basin import Basin
from fvsolve.parts.chamber import Chamber
from fvsolve.parts.check_valve import CheckValve
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
from fvsolve.parts.pipe import Pipe, Wall
from fvsolve.parts.pump import Pump
from fvsolve.parts.regulating import FlowControl, PressureReducing, PressureSustaining
from fvsolve.parts.relief_valve import ReliefValve
from fvsolve.parts.reservoir import Reservoir
from fvsolve.parts.rigid_column import RigidColumn
from fvsolve.parts.scalar import Scalar
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.spool_valve import EDGES, SpoolValve
from fvsolve.parts.spring import Spring
from fvsolve.parts.tank import AreaTable, Tank
from fvsolve.parts.torque import Torque
from fvsolve.parts.valve import Characteristic, Valve

KINDS = {"nodes": Node.kinds, "links": Link.kinds}

__all__ = [
    "EDGES", "KINDS", "Accumulator", "AirValve", "AreaTable", "Basin", "Chamber", "Characteristic", "CheckValve",
    "Cylinder", "Damper", "EndStop", "FlowControl", "Force", "Frame", "Friction", "Inflow", "Junction", "Leak", "Link",
    "Mass", "Node", "Orifice", "Pipe", "PressureReducing", "PressureSustaining", "Pump", "ReliefValve", "Reservoir",
    "RigidColumn", "Scalar", "Schedule", "SpoolValve", "Spring", "Tank", "Torque", "Valve", "Wall",
]  # fmt: skip
