"""A motor that turns a load through a soft shaft: four uncertain parameters, gain and friction among them."""

import control
import numpy as np

import boomctl as bc
from boomctl.structure import SecondOrderModel

RIG = {"gain": 0.5, "load": 0.05, "shaft": 8.0, "friction": 0.05}  # N m/V, kg m^2, N m/rad, N m s/rad
START = {"gain": 0.4, "load": 0.06, "shaft": 7.0, "friction": 0.08}
MOTOR, LOSS = 0.02, 0.004  # kg m^2, N m s/rad of the shaft: known
OMEGA = 2.0 * np.pi * np.geomspace(0.5, 8.0, 40)


def rig(p):
    """Return the motor and its load as a structure, driven by a voltage, both angles measured."""
    k = p["shaft"]
    return SecondOrderModel(
        np.diag([MOTOR, p["load"]]),
        np.array([[p["friction"] + LOSS, -LOSS], [-LOSS, LOSS]]),
        np.array([[k, -k], [-k, k]]),
        {"volt": [p["gain"], 0.0]},
        {"motor": [1.0, 0.0], "load": [0.0, 1.0]},
    )


def measured(rng, truth=None, noise=0.03):
    """Return a frequency response with errors."""
    G = np.asarray(rig(truth or RIG).frequency_response(OMEGA).frdata)
    errors = noise * (rng.standard_normal(G.shape) + 1j * rng.standard_normal(G.shape))
    return control.frd(G * (1.0 + errors), OMEGA, inputs=["volt"], outputs=["motor", "load"])


def weighed(model):
    """Return a generalized plant: the load is to follow, the voltage is not to be large."""
    return bc.generalized_plant(
        model,
        disturbances={"volt": 1.0},
        performance={"load": 10.0},
        effort={"volt": 0.3},
        noise={"motor": 0.01},
        measurements="motor",
        controls="volt",
    )
