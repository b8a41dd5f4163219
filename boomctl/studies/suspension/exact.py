"""The exact boom with the sensors of a suspension: no discretisation, frequency by frequency."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from boomctl.arrays import Array
from boomctl.boom import BoomParameters, exact_frequency_response
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.studies.suspension.scene import ACCELERATIONS, CONTROLS, STROKES

if TYPE_CHECKING:
    import control


def exact_plant(
    parameters: BoomParameters, accelerometer_hz: float = 20.0
) -> "Callable[[Array], control.FrequencyResponseData]":
    """Return the frequency response of the exact boom to platform and suspension, as a function of frequency [rad/s].

    Signals as of :func:`suspension_model`; an accelerometer is the second derivative of a tip behind a
    second-order low pass, ``-w^2 F(i w)``, with the damping ratio of the model's, the square root of one half.
    """
    corner = 2.0 * np.pi * accelerometer_hz

    def at(omega: Array) -> "control.FrequencyResponseData":
        from boomctl.lti.python_control import control

        found = exact_frequency_response(parameters, omega, (*ACTUATORS, *CONTROLS), (*TIPS, *STROKES))
        s = 1j * np.asarray(omega, dtype=float)
        reads = s**2 * corner**2 / (s**2 + np.sqrt(2.0) * corner * s + corner**2)
        data = np.asarray(found.frdata)
        whole = np.concatenate([data, reads * data[: len(TIPS)]])
        return control.frd(
            whole,
            omega,
            inputs=[*ACTUATORS, *CONTROLS],
            outputs=[*TIPS, *STROKES, *ACCELERATIONS],
            name="exact boom",
        )

    return at
