"""The hub-beam in exudyn, a general-purpose flexible multibody code: for comparison, where it is installed.

ANCF cable elements (Gerstmayr & Irschik 2008: bending by the derivative of the rotation along the undeformed arc
length, as in the geometrically exact beam here), a rigid hub, generalised-alpha integration.
"""

from collections.abc import Callable
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp
from boomctl.rotating_beam.parameters import HubBeamParameters

NEWTON_TOLERANCE = 1e-6
"""Relative and absolute; 1e-8 is often missed in a prescribed motion, and then takes 20 times longer."""

SPECTRAL_RADIUS = 0.5  # of generalised alpha: damps what the time step does not resolve, and keeps second order


def exudyn_tip(
    parameters: HubBeamParameters, manoeuvre: SpinUp | SineTorque, timepts: Array, elements: int, step: float
) -> Array:
    """Transverse tip displacement in the hub's frame, computed by exudyn.

    Parameters
    ----------
    parameters : HubBeamParameters
        Without tip mass and damping.
    manoeuvre : SpinUp or SineTorque
    timepts : ndarray, k
        Instants, equally spaced from 0, s.
    elements : int
        Number of equal elements.
    step : float
        Time step, s, which divides the distance of the instants.

    Returns
    -------
    ndarray, k
        In m.

    Raises
    ------
    ImportError
        If exudyn is not installed.
    ValueError
        If the beam has a tip mass or damping.
    """
    if parameters.tip_mass > 0.0 or parameters.damping_ratio > 0.0:
        raise ValueError("parameters: expected neither tip mass nor damping")
    exudyn = import_module("exudyn")
    container = exudyn.SystemContainer()
    system = container.AddSystem()
    hub = _hub(system, parameters)
    last = _beam(system, parameters, hub, elements)
    _drive(system, hub, manoeuvre)
    position, angle = _sensors(exudyn, system, hub, last, parameters.length / elements)
    system.Assemble()
    system.SolveDynamic(_settings(exudyn, timepts, step), showHints=False)
    data, turned = system.GetSensorStoredData(position), system.GetSensorStoredData(angle)
    tip = (data[:, 1] + 1j * data[:, 2]) * np.exp(-1j * turned[:, 3])
    return np.interp(timepts, data[:, 0], tip.imag)


def _hub(system: Any, parameters: HubBeamParameters) -> tuple[int, int]:
    """Node and body of a hub that turns about the origin."""
    item = import_module("exudyn.itemInterface")

    ground = system.AddObject(item.ObjectGround())
    node = system.AddNode(item.NodeRigidBody2D(referenceCoordinates=[0, 0, 0]))
    body = system.AddObject(item.ObjectRigidBody2D(mass=1.0, inertia=parameters.hub_inertia, nodeNumber=node))
    markers = [system.AddMarker(item.MarkerBodyPosition(bodyNumber=each)) for each in (ground, body)]
    system.AddObject(item.ObjectJointRevolute2D(markerNumbers=markers))
    return node, body


def _beam(system: Any, parameters: HubBeamParameters, hub: tuple[int, int], elements: int) -> int:
    """Cable elements clamped to the hub; the last one."""
    item = import_module("exudyn.itemInterface")

    size, radius = parameters.length / elements, parameters.hub_radius
    nodes = [
        system.AddNode(item.NodePoint2DSlope1(referenceCoordinates=[radius + k * size, 0, 1, 0]))
        for k in range(elements + 1)
    ]
    cables = [
        system.AddObject(
            item.ObjectANCFCable2D(
                length=size,
                massPerLength=parameters.mass_per_length,
                bendingStiffness=parameters.bending_stiffness,
                axialStiffness=parameters.axial_stiffness,
                nodeNumbers=list(pair),
            )
        )
        for pair in pairwise(nodes)
    ]
    clamp = system.AddMarker(item.MarkerBodyRigid(bodyNumber=hub[1], localPosition=[radius, 0, 0]))
    root = system.AddMarker(item.MarkerBodyRigid(bodyNumber=cables[0], localPosition=[0, 0, 0]))
    system.AddObject(item.ObjectJointGeneric(markerNumbers=[clamp, root], constrainedAxes=[1, 1, 0, 0, 0, 1]))
    return cables[-1]


def _drive(system: Any, hub: tuple[int, int], manoeuvre: SpinUp | SineTorque) -> None:
    item = import_module("exudyn.itemInterface")

    if isinstance(manoeuvre, SpinUp):
        fixed = system.AddMarker(
            item.MarkerNodeCoordinate(nodeNumber=system.AddNode(item.NodePointGround()), coordinate=0)
        )
        turning = system.AddMarker(item.MarkerNodeCoordinate(nodeNumber=hub[0], coordinate=2))
        angle: Callable[..., float] = lambda mbs, t, number, offset: float(manoeuvre.angle(t))  # noqa: E731
        system.AddObject(
            item.ObjectConnectorCoordinate(markerNumbers=[fixed, turning], offset=0, offsetUserFunction=angle)
        )
    else:
        marker = system.AddMarker(item.MarkerBodyRigid(bodyNumber=hub[1]))
        torque: Callable[..., list[float]] = lambda mbs, t, load: [0.0, 0.0, float(manoeuvre.torque(t))]  # noqa: E731
        system.AddLoad(item.LoadTorqueVector(markerNumber=marker, loadVector=[0, 0, 1], loadVectorUserFunction=torque))


def _sensors(exudyn: Any, system: Any, hub: tuple[int, int], last: int, size: float) -> tuple[int, int]:
    """Position of the free end, and coordinates of the hub."""
    item = import_module("exudyn.itemInterface")

    kinds = exudyn.OutputVariableType
    position = item.SensorBody(
        bodyNumber=last, localPosition=[size, 0, 0], storeInternal=True, outputVariableType=kinds.Position
    )
    angle = item.SensorNode(nodeNumber=hub[0], storeInternal=True, outputVariableType=kinds.Coordinates)
    return system.AddSensor(position), system.AddSensor(angle)


def _settings(exudyn: Any, timepts: Array, step: float) -> Any:
    settings = exudyn.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime = float(timepts[-1])
    integration.numberOfSteps = round(float(timepts[-1]) / step)
    integration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    integration.newton.useModifiedNewton = True
    integration.newton.relativeTolerance = integration.newton.absoluteTolerance = NEWTON_TOLERANCE
    integration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = float(timepts[1] - timepts[0])
    settings.parallel.numberOfThreads = 1
    return settings
