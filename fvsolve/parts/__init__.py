"""Types of parts: keys, conversion to table rows, compiled laws; may import kernels and base classes of `core`."""

from fvsolve.lazy_exports import lazy_names
from fvsolve.parts.nodes_and_links import Link, Node
from fvsolve.parts.plugins import declare_installed

_MODULES = {
    "AreaTable": "tank",
    "Basin": "basin",
    "Chamber": "hydraulic_nodes",
    "Characteristic": "valve",
    "Cylinder": "cylinder",
    "Damper": "translational",
    "EndStop": "translational",
    "Force": "translational",
    "Frame": "translational",
    "Friction": "full_pipe",
    "Inflow": "hydraulic_nodes",
    "Junction": "hydraulic_nodes",
    "Leak": "outlet.part",
    "Mass": "translational",
    "Orifice": "valve",
    "Pipe": "pipe.part",
    "Reservoir": "hydraulic_nodes",
    "RigidColumn": "rigid_column",
    "Scalar": "carried_scalar",
    "Schedule": "schedule",
    "SpoolValve": "spool_valve.part",
    "Spring": "translational",
    "Tank": "tank",
    "Torque": "body_links",
    "Valve": "valve",
    "Wall": "pipe.pipe_wall",
}

KINDS = {"nodes": Node.kinds, "links": Link.kinds}

__all__ = [*lazy_names(__name__, _MODULES), "KINDS", "Link", "Node"]  # noqa: PLE0604

declare_installed()
