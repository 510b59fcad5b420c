"""Peers of mechanisms.py: a chain in MuJoCo and an arm on a cylinder in exudyn, and both scenes as cases of fvsolve."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
LINK = {"length": 1.0, "mass": 1.0, "across": 1.0 / 12.0, "along": 1e-3}
CHAIN, CHAIN_END, GRAVITY = (1.2, 0.5, -0.4), 5.0, 9.80665  # [rad], [s]
ARM_END, ROWS = 1.0, 200
# arm: mass [kg], length [m], moment of inertia about its centre [kg m2]
MASS, LONG, SWUNG = 120.0, 1.0, 120.0 / 12.0
FOOT, EYE = -0.25, 0.25  # ends of the cylinder: below the pivot, and along the arm [m]
AREAS, DEAD, STROKE, BETA = (1e-3, 6e-4), (2e-4, 2e-4), 0.2, 1.2e9
# gauge pressures of the pump, of the tank, and of chamber B at the start [Pa]
SUPPLY, RETURN, BACK = 2e7, 1e5, 6e5
FLOW = 1e-4 / np.sqrt(1e5) * 0.1  # coefficient of an open edge of the valve [m3/s/Pa^(1/2)]
RHO, CD = 870.0, 0.61
OPENS = ((0.1, 0.0), (0.12, 1.0), (0.5, 1.0), (0.52, 0.0))


def chain_case(steps: int) -> dict:
    """Case of a chain of three uniform rods, stepped by rk4."""
    from reference.bodies import bodies, body

    found, half = {}, [0, 0, -LINK["length"] / 2]
    for k, angle in enumerate(CHAIN):
        joint = {"kind": "revolute", "axis": [0, 1, 0], "angle": angle}
        if k > 0:
            joint |= {"on": f"b{k - 1}", "at": [0, 0, -LINK["length"]]}
        moments = [LINK["across"], LINK["across"], LINK["along"]]
        found[f"b{k}"] = body(LINK["mass"], moments, joint, centre_of_mass=half)
    probes = [f"b{k}.angle" for k in range(len(CHAIN))]
    case = bodies(found, CHAIN_END, probes, every=CHAIN_END, method="rk4", step=CHAIN_END / steps)
    case["output"]["fields"] = 0
    return case


def chain_in_mujoco(steps: int) -> tuple[np.ndarray, float]:
    """Angles at the end [rad] and CPU time of the steps [s] in MuJoCo, without contacts and constraints."""
    import mujoco

    rod = (
        '<body pos="0 0 {z}"><joint type="hinge" axis="0 1 0"/><inertial pos="0 0 -0.5" mass="1" '
        f'diaginertia="{LINK["across"]!r} {LINK["across"]!r} {LINK["along"]!r}"/>'
    )
    rods = "".join(rod.format(z=0 if k == 0 else -1) for k in range(len(CHAIN))) + "</body>" * len(
        CHAIN
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{CHAIN_END / steps!r}" integrator="RK4" gravity="0 0 {-GRAVITY}">'
        f'<flag contact="disable" constraint="disable"/></option><worldbody>{rods}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qpos[:] = CHAIN
    began = process_time()
    mujoco.mj_step(model, data, steps)
    return data.qpos.copy(), process_time() - began


def held() -> float:
    """Gauge pressure in chamber A that supports the arm [Pa]."""
    lever = EYE * -FOOT / np.hypot(EYE, FOOT)
    return (MASS * GRAVITY * LONG / 2.0 / lever + AREAS[1] * BACK) / AREAS[0]


def arm_case(rtol: float) -> dict:
    """Case of an arm that a cylinder lifts through a valve, which opens for 0.4 s."""
    from reference.bodies import bodies, body
    from reference.scenes import AMBIENT, reservoir

    hinge = {"kind": "revolute", "axis": [0, -1, 0]}
    nodes = {
        "arm": body(
            MASS,
            [1.0, SWUNG, SWUNG],
            hinge,
            centre_of_mass=[LONG / 2, 0, 0],
            points={"eye": [EYE, 0, 0]},
        ),
        "ground": {"type": "frame", "points": {"foot": [0, 0, FOOT]}},
        "pump": reservoir(AMBIENT + SUPPLY),
        "tank": reservoir(AMBIENT + RETURN),
    }
    lift = {
        "type": "cylinder",
        "ports": {"case": "ground.foot", "rod": "arm.eye"},
        "stroke": STROKE,
        "closed_length": float(np.hypot(EYE, FOOT)),
        "area_A": AREAS[0],
        "area_B": AREAS[1],
        "dead_volume_A": DEAD[0],
        "dead_volume_B": DEAD[1],
        "initial_pressure_A": AMBIENT + held(),
        "initial_pressure_B": AMBIENT + BACK,
    }
    spool = {
        "type": "spool-valve",
        "ports": {"P": "pump", "T": "tank", "A": "lift.A", "B": "lift.B"},
        "discharge_coefficient": CD,
        "area": float(FLOW / CD * np.sqrt(RHO / 2.0)),
        "position": {"time": [t for t, _ in OPENS], "value": [x for _, x in OPENS]},
    }
    oil = {
        "name": "user",
        "density": RHO,
        "bulk_modulus": BETA,
        "viscosity": 0.028,
        "vapor_pressure": 100.0,
    }
    case = bodies(
        nodes, ARM_END, ["arm.angle"], {"lift": lift, "spool": spool}, ARM_END / ROWS, rtol=rtol
    )
    case["output"]["fields"] = 0
    return case | {"fluid": oil}


def arm_in_exudyn(steps: int) -> tuple[np.ndarray, float]:
    """Angles of the arm [rad] and CPU time of the steps [s] in exudyn, without the Python function of the valve.

    The chambers of exudyn balance volumes of oil, those of fvsolve masses, so the angles differ by 1 to 5 %.
    """
    import exudyn as exu
    import exudyn.utilities as make

    warnings.simplefilter("ignore", DeprecationWarning)
    system, spent = exu.SystemContainer().AddSystem(), [0.0]
    node = system.AddNode(make.Rigid2D(referenceCoordinates=[LONG / 2, 0, 0]))
    arm = system.AddObject(
        make.RigidBody2D(physicsMass=MASS, physicsInertia=SWUNG, nodeNumber=node)
    )
    ground = system.AddObject(make.ObjectGround())

    def marker(body, x, y):
        return system.AddMarker(make.MarkerBodyPosition(bodyNumber=body, localPosition=[x, y, 0]))

    system.AddObject(
        make.RevoluteJoint2D(markerNumbers=[marker(ground, 0, 0), marker(arm, -LONG / 2, 0)])
    )
    system.AddLoad(make.Force(markerNumber=marker(arm, 0, 0), loadVector=[0, -MASS * GRAVITY, 0]))
    oil = system.AddNode(
        make.NodeGenericODE1(
            referenceCoordinates=[0, 0],
            initialCoordinates=[held(), BACK],
            numberOfODE1Coordinates=2,
        )
    )
    lift = system.AddObject(
        make.HydraulicActuatorSimple(
            markerNumbers=[marker(ground, 0, FOOT), marker(arm, EYE - LONG / 2, 0)],
            nodeNumbers=[oil],
            offsetLength=np.hypot(EYE, FOOT),
            strokeLength=STROKE,
            chamberCrossSection0=AREAS[0],
            chamberCrossSection1=AREAS[1],
            hoseVolume0=DEAD[0],
            hoseVolume1=DEAD[1],
            valveOpening0=0,
            valveOpening1=0,
            actuatorDamping=0,
            oilBulkModulus=BETA,
            nominalFlow=FLOW,
            systemPressure=SUPPLY,
            tankPressure=RETURN,
            useChamberVolumeChange=True,
        )
    )

    def turn_valve(system, t):
        began = process_time()
        opening = float(np.interp(t, *zip(*OPENS, strict=True)))
        system.SetObjectParameter(lift, "valveOpening0", opening)
        system.SetObjectParameter(lift, "valveOpening1", -opening)
        spent[0] += process_time() - began
        return True

    system.SetPreStepUserFunction(turn_valve)
    angle = exu.OutputVariableType.Coordinates
    sensor = system.AddSensor(
        make.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=angle)
    )
    system.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, ARM_END
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = ARM_END / ROWS
    began = process_time()
    system.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    busy = process_time() - began - spent[0]
    return system.GetSensorStoredData(sensor)[:, 3], busy
