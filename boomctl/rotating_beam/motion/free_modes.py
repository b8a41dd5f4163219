"""Vibrations of the hub-beam with its hub free, and the nonlinear forces between them."""

from dataclasses import dataclass
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.equations import FreeHubForm

_SOFTEST = 0.1  # Least stiffness at a hub speed, relative to the lowest at rest, for linearization about this speed.


@final
@dataclass(frozen=True, eq=False)
class FreeModes:
    """Modes of a window, with the stiffness that its hub speed gives; first the free mass, then n vibrations.

    Attributes
    ----------
    form : FreeHubForm
    shapes : ndarray, n x n
        ``x = shapes z``.
    square : float
        Hub speed squared at which the modes are decoupled, rad^2/s^2.
    rates : complex ndarray, 1 + n
        Of the oscillators, 1/s; i of the free mass.
    push : ndarray, 1 + n
        Modal input vector of a torque; also the hub speed per rate of each mode.
    slope, gyro, damping : ndarray, n x n
        Of the vibrations; the last without its diagonal, which is in the rates.
    axial : ndarray, n
    stiffness : ndarray, n x 1
        Of the vibrations.
    mobility : float
        Acceleration of the hub by a torque.
    """

    form: FreeHubForm
    shapes: Array
    square: float
    rates: Array
    push: Array
    slope: Array
    gyro: Array
    damping: Array
    axial: Array
    stiffness: Array
    mobility: float

    def forces(self, z: Array, rate: Array, torque: Array) -> tuple[Array, Array]:
        """Return the modal forces of torque and nonlinear terms, and a value that must be positive.

        The hub's acceleration depends on the forces and vice versa: both are solved together.

        Parameters
        ----------
        z, rate : ndarray, (1 + n) x k
            Modal coordinates and rates at k times.
        torque : ndarray, k
            N m.

        Returns
        -------
        force : ndarray, (1 + n) x k
        solvable : ndarray, k
            Positive where the mass matrix is positive definite.
        """
        form, x, v = self.form, z[1:], rate[1:]
        push, mobility = self.push[1:], self.mobility
        w = self.push @ rate
        bent = self.slope @ x
        inertia = _dot(x, bent)
        square = w * w
        force = (square - self.square) * bent
        hub = torque
        if form.keeps_inertia_torque:
            hub = hub - 2.0 * w * _dot(bent, v)
        back = self.stiffness * x
        if form.decay:
            force -= self.damping @ v
            back -= 2.0 * self.rates.real[1:, None] * v
        if not form.has_axial:
            solvable = 1.0 + mobility * inertia
            turning = (mobility * hub + push @ (force - back)) / solvable
            hub = hub - inertia * turning
        else:
            inertia += 2.0 * (self.axial @ x)
            force += 2.0 * w * (self.gyro @ v)
            force += square * self.axial[:, None]
            if form.keeps_inertia_torque:
                hub = hub - 2.0 * w * (self.axial @ v)
            coupling = -(self.gyro @ x)
            linear = force - back
            crossed, squared = push @ coupling, _dot(coupling, coupling)
            # hub acceleration and coupling times beam acceleration: two equations in closed form
            right = mobility * hub + push @ linear, crossed * hub + _dot(coupling, linear)
            first, last, low = 1.0 + crossed + mobility * inertia, 1.0 + crossed, crossed * inertia + squared
            solvable = first * last - mobility * low
            turning = (right[0] * last - mobility * right[1]) / solvable
            force -= coupling * turning
            hub = hub - inertia * turning - (first * right[1] - low * right[0]) / solvable
        result = self.push[:, None] * hub
        result[1:] += force
        return result, solvable

    def impulses(self, z: Array, jump: Array) -> Array:
        """Return impulses on the modes, (1 + n) x k, for vibrations that start with rates ``jump`` and are then omitted.

        The inertial coupling of a vibration to the other modes has zero mean, except for the impulse at its start.

        Parameters
        ----------
        z : ndarray, (1 + n) x k
        jump : ndarray, n x k
            Rates of the vibrations that begin.
        """
        x, turning = z[1:], self.push[1:] @ jump
        hub = _dot(x, self.slope @ x) * turning
        result = np.zeros_like(z)
        if self.form.has_axial:
            coupling = -(self.gyro @ x)
            hub += 2.0 * (self.axial @ x) * turning + _dot(coupling, jump)
            result[1:] = coupling * turning
        result += self.push[:, None] * hub
        return result


def free_modes(form: FreeHubForm, speed: float) -> FreeModes:
    """Return the modes at a hub speed [rad/s], or at rest if the stiffness at this speed is too small."""
    for square in (speed**2, 0.0):
        values, shapes = np.linalg.eigh(form.stiffness - square * form.slope)
        damping = shapes.T @ form.damping @ shapes
        sigma = 0.5 * np.diag(damping)
        if values[0] >= _SOFTEST * form.softest and (values > sigma**2).all():
            break
    push = np.concatenate([[form.inertia**-0.5], form.lean @ shapes])
    return FreeModes(
        form=form,
        shapes=shapes,
        square=square,
        rates=np.concatenate([[1j], -sigma + 1j * np.sqrt(values - sigma**2)]),
        push=push,
        slope=shapes.T @ form.slope @ shapes,
        gyro=shapes.T @ form.gyro @ shapes,
        damping=damping - np.diag(2.0 * sigma),
        axial=form.axial @ shapes,
        stiffness=values[:, None],
        mobility=float(push @ push),
    )


def _dot(a: Array, b: Array) -> Array:
    """Products summed over the modes, k."""
    return np.einsum("ik,ik->k", a, b)
