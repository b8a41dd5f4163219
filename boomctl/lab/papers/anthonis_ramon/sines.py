"""Response to sines of a structure with Coulomb friction: by a describing function, and simulated in time.

Sliding friction of force ``F`` has the fundamental ``4 F/pi``, opposite to the slip velocity: an equivalent viscous
damping ``4 F/(pi omega A)`` at the slip amplitude ``A``.  With the plant's receptances the harmonic balance
``|A + j (4 F/pi) H| = |S|`` (``S`` the slip without friction, ``H`` the slip per unit friction force) is a quadratic in
``A``, solved here in closed form; where it has no positive root the contact sticks.

Source: Den Hartog (1931) for the damper, Gelb & Vander Velde (1968) for the method.
"""

from dataclasses import dataclass, replace

import numpy as np

from boomctl.arrays import Array
from boomctl.simulation.contact.friction import CoulombFriction
from boomctl.simulation.loop import simulate_loop
from boomctl.structure.model import SecondOrderModel

_STEPS = 200  # per period of the simulated sine
_PERIODS = 32  # simulated from the harmonic balance on; the fundamental is that of all but the first quarter


@dataclass(frozen=True)
class SineResponse:
    """Fundamental of the steady response to a sine with friction.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    response : (n,) complex ndarray
        Fundamental of the output per unit excitation.
    slip : (n,) complex ndarray
        Fundamental of the slip [m]; 0 where the describing function sticks.
    force : (n,) complex ndarray
        Fundamental of the friction force by the describing function [N].
    """

    omega: Array
    response: Array
    slip: Array
    force: Array

    @property
    def gain(self) -> Array:
        """Magnitude of the response."""
        return np.abs(self.response)


def describing_function(
    plant: SecondOrderModel, friction: CoulombFriction, omega: Array, excitation: str, amplitude: float, output: str
) -> SineResponse:
    """Return the response of a plant with friction to sines by harmonic balance.

    Parameters
    ----------
    plant : SecondOrderModel
        The plant without friction.
    friction : CoulombFriction
        Where friction acts; its static force has no effect on a harmonic balance.
    omega : (n,) ndarray
        Angular frequencies [rad/s], above zero.
    excitation : str
        Input that is excited.
    amplitude : float
        Amplitude of the excitation, in the unit of the input.
    output : str
        Output that is read.
    """
    H = np.asarray(plant.frequency_response(omega, [excitation, friction.input], [output, friction.output]).frdata)
    (moved, free), receptance, level = amplitude * H[:, 0], H[1, 1], 4.0 * friction.force / np.pi
    turned = 1j * level * receptance
    slip_size = np.sqrt(np.maximum(np.abs(free) ** 2 - np.imag(turned) ** 2, 0.0)) - np.real(turned)
    sliding = slip_size > 0.0
    force = np.where(sliding, -1j * level * free / np.where(sliding, slip_size + turned, 1.0), -free / receptance)
    return SineResponse(omega, (moved + H[0, 1] * force) / amplitude, free + receptance * force, force)


def stepped_sine(
    plant: SecondOrderModel, friction: CoulombFriction, omega: Array, excitation: str, amplitude: float, output: str
) -> SineResponse:
    """Return the response of a plant with friction to sines, simulated with stick-slip one frequency after the other.

    Each simulation begins in the state of the harmonic balance; its fundamental is weighted by a Hann window, so that a
    lightly damped mode that still rings averages out.

    Parameters
    ----------
    plant, friction, omega, excitation, amplitude, output
        As for :func:`describing_function`; break-away at the static force is simulated.
    """
    system = plant.to_statespace()
    A, B = np.asarray(system.A), np.asarray(system.B)
    acting = [system.input_labels.index(name) for name in (excitation, friction.input)]
    phase = 2.0 * np.pi / _STEPS * np.arange(_PERIODS * _STEPS + 1)
    late = phase >= 0.5 * np.pi * _PERIODS
    window = np.hanning(late.sum())
    weights = 2.0 * window / window.sum() * np.exp(-1j * phase[late])
    balance, fundamentals = describing_function(plant, friction, omega, excitation, amplitude, output), []
    for w, force in zip(omega, balance.force, strict=True):
        start = np.linalg.solve(1j * w * np.eye(len(A)) - A, B[:, acting] @ [amplitude, force]).real
        excited, step = {excitation: amplitude * np.cos(phase)}, phase[1] / w
        law = replace(friction, substeps=1)
        found = simulate_loop(system, None, excited, phase / w, sample_time=step, friction=law, initial=start)
        fundamentals.append([weights @ found[name][late] for name in (output, friction.output)])
    response, slip = np.array(fundamentals).T
    return SineResponse(omega, response / amplitude, slip, balance.force)
