"""A slew as a film: the geometrically exact beam under a sine torque."""

import numpy as np

from boomctl.plotting.rotating_beam import Film
from boomctl.rotating_beam import HubBeamParameters, sine_torque
from boomctl.rotating_beam.exact.beam import GeometricallyExactBeam


def slew_film(torque: float = 200.0, frames_per_second: int = 10) -> Film:
    """Film a slew by one period of a sine torque in 10 s, and the vibration left after it.

    Parameters
    ----------
    torque : float
        Largest torque, N m.
    frames_per_second : int
        Of the film, which runs in real time.
    """
    beam = GeometricallyExactBeam(HubBeamParameters(), 6)
    time = np.arange(0, 14 * frames_per_second + 1) / frames_per_second
    states = beam.simulate(sine_torque(torque, 10.0, 10.0), time, rtol=1e-6).states
    return Film(time, (("exact", beam.shape(states)),), beam.parameters.hub_radius, f"slew, {torque:g} N m")
