"""Vibrations of the hub-beam with its hub free, and the forces between them that the linear equations leave out."""

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from boomctl.arrays import Array
from boomctl.rotating_beam.modal.equations import FreeHubForm
from boomctl.rotating_beam.motion.oscillators import Oscillators

_SOFTEST = 0.1  # of the lowest stiffness at rest: a speed that leaves less is not linearized about; a choice


@final
@dataclass(frozen=True, eq=False)
class FreeModes:
    """Modes of b = 1 window, with the stiffness that its hub speed gives; first the free mass, then n vibrations.

    Attributes
    ----------
    form : FreeHubForm
    shapes : ndarray, b x n x n
        ``x = shapes z``.
    square : ndarray, b
        Hub speed squared at which the modes are decoupled, rad^2/s^2.
    oscillators : Oscillators
    push : ndarray, b x (1 + n)
        What a torque does to each mode; also the hub speed that goes with its rate.
    slope, gyro, damping : ndarray, b x n x n
        Of the vibrations; the last without its diagonal, which is in the oscillators.
    axial : ndarray, b x n
    """

    form: FreeHubForm
    shapes: Array
    square: Array
    oscillators: Oscillators
    push: Array
    slope: Array
    gyro: Array
    damping: Array
    axial: Array

    def hub_speed(self, rate: Array) -> Array:
        """Of modal rates, b x (1 + n) x k; b x 1 x k."""
        return self.push[:, None] @ rate

    def forces(self, z: Array, rate: Array, torque: Array) -> tuple[Array, Array]:
        """Modal forces of torque and all that is not linear, and what has to be > 0 for them.

        The hub's acceleration is solved for: it takes part in the forces, and these in it.

        Parameters
        ----------
        z, rate : ndarray, b x (1 + n) x k
            Modal coordinates and rates at k instants.
        torque : ndarray, b x 1 x k
            N m.

        Returns
        -------
        force : ndarray, b x (1 + n) x k
        solvable : ndarray, b x 1 x k
            Positive where the mass matrix is positive definite.
        """
        form, x, v = self.form, z[:, 1:], rate[:, 1:]
        push, mobility = self.push[:, None, 1:], self.mobility
        w = self.hub_speed(rate)
        bent = self.slope @ x
        inertia = _dot(x, bent)
        square = w * w
        force = (square - self.square[:, None, None]) * bent
        hub = torque
        if form.keeps_inertia_torque:
            hub = hub - 2.0 * w * _dot(bent, v)
        back = self.stiffness * x
        if self.form.decay:
            force -= self.damping @ v
            back += 2.0 * self.oscillators.sigma[..., None] * v
        if not form.has_axial:
            solvable = 1.0 + mobility * inertia
            turning = (mobility * hub + push @ (force - back)) / solvable
            hub = hub - inertia * turning
        else:
            axial = self.axial[:, None]
            inertia += 2.0 * (axial @ x)
            force += 2.0 * w * (self.gyro @ v)
            force += square * self.axial[..., None]
            if form.keeps_inertia_torque:
                hub = hub - 2.0 * w * (axial @ v)
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
        result = self.push[..., None] * hub
        result[:, 1:] += force
        return result, solvable

    def impulses(self, z: Array, jump: Array) -> Array:
        """Impulses on the modes, b x (1 + n) x k, for vibrations that begin with given rates and are left out from then on.

        What couples them to the rest by inertia turns with them and does nothing in the mean, but for how it began.

        Parameters
        ----------
        z : ndarray, b x (1 + n) x k
        jump : ndarray, b x n x k
            Rates of the vibrations that begin.
        """
        x, turning = z[:, 1:], self.push[:, None, 1:] @ jump
        hub = _dot(x, self.slope @ x) * turning
        result = np.zeros_like(z)
        if self.form.has_axial:
            coupling = -(self.gyro @ x)
            hub += 2.0 * (self.axial[:, None] @ x) * turning + _dot(coupling, jump)
            result[:, 1:] = coupling * turning
        result += self.push[..., None] * hub
        return result

    @cached_property
    def stiffness(self) -> Array:
        """Of the vibrations, b x n x 1."""
        return (self.oscillators.sigma**2 + self.oscillators.omega**2)[..., None]

    @cached_property
    def mobility(self) -> Array:
        """Acceleration of the hub by a torque, b x 1 x 1."""
        return (self.push[:, None] @ self.push[..., None]).reshape(-1, 1, 1)


def free_modes(form: FreeHubForm, speed: Array) -> FreeModes:
    """Return the modes at hub speeds [rad/s], b; at rest where a speed leaves too little stiffness to vibrate."""
    square = speed**2
    while True:
        values, shapes = np.linalg.eigh(form.stiffness - square[:, None, None] * form.slope)
        turned = shapes.swapaxes(1, 2)
        damping = turned @ form.damping @ shapes
        sigma = 0.5 * np.einsum("bii->bi", damping)
        soft = (values[:, 0] < _SOFTEST * form.softest) | (values <= sigma**2).any(axis=1)
        if not soft.any() or not square[soft].any():
            break
        square = np.where(soft, 0.0, square)
    np.einsum("bii->bi", damping)[...] = 0.0
    push = np.empty((speed.size, form.lean.size + 1))
    push[:, 0], push[:, 1:] = 1.0 / np.sqrt(form.inertia), form.lean @ shapes
    return FreeModes(
        form=form,
        shapes=shapes,
        square=square,
        oscillators=Oscillators(sigma, np.sqrt(values - sigma**2), bool(form.decay)),
        push=push,
        slope=turned @ form.slope @ shapes,
        gyro=turned @ form.gyro @ shapes,
        damping=damping,
        axial=form.axial @ shapes,
    )


def _dot(a: Array, b: Array) -> Array:
    """Products summed over the modes, b x 1 x k."""
    return np.einsum("bik,bik->bk", a, b)[:, None]
