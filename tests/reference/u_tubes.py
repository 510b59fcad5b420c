"""Cases of a U-tube on a rolling body."""

from reference.scenes import scene

# half distance of arms, depth of the duct, level above the duct [m]
HALF, DEPTH, LEVEL = 4.0, 1.5, 0.8
TANK, BORE, LOSS = 1.2, 0.6, 3.0  # area of tanks [m2], bore of the duct [m], loss [-]
ROLL = {"mean": 0.0, "amplitude": 0.05, "period": 7.0}  # [rad], [s]
SOLID = {"mass": 1.0, "inertia": [1.0, 1.0, 1.0]}


def hull(**joint):
    """Return a body with a driven joint."""
    return {"type": "body", **SOLID, "joint": joint}


def u_tube(turned=False, swap=False, angle=ROLL, **column):
    """Return a case of a U-tube on a rolling body; `turned` puts its bow along y, `swap` reverses the duct."""

    def named(x, y, z):
        return [-y, x, z] if turned else [x, y, z]

    ends = ("starboard", "port") if swap else ("port", "starboard")
    return scene(
        {
            "hull": hull(kind="revolute", axis=named(1, 0, 0), angle=angle),
            "port": {
                "type": "tank",
                "on": "hull",
                "at": named(0, HALF, -DEPTH),
                "area": TANK,
                "level": LEVEL,
            },
            "starboard": {
                "type": "tank",
                "on": "hull",
                "at": named(0, -HALF, -DEPTH),
                "area": TANK,
                "level": LEVEL,
            },
        },
        {
            "duct": {
                "type": "rigid-column",
                "from": ends[0],
                "to": ends[1],
                "length": 2 * HALF,
                "diameter": BORE,
                "minor_loss": LOSS,
                **column,
            }
        },
        20.0,
        {"method": "dormand-prince", "rtol": 1e-9},
        ["duct.flow", "port.level", "starboard.level"],
        every=0.1,
    )
