"""Motion between the nodes of its steps: a polynomial and a free vibration of each mode on every step."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.rotating_beam.modal.equations import FreeHubForm
from boomctl.rotating_beam.motion.free_modes import FreeModes
from boomctl.rotating_beam.motion.oscillators import coordinates, free_mass, responses, turning

SMOOTH = 1.0  # Phase in a step up to which a motion from rest is a polynomial, to 5e-13 with 8 nodes.


@final
@dataclass(frozen=True, eq=False)
class Vibrations:
    """Vibrations of n modes through w windows, one after another, of up to m equal steps with s nodes.

    Attributes
    ----------
    begin, h : ndarray, w
        Start time of each window and length of its steps, s.
    steps : ndarray of int, w
        Number of steps of each window.
    rates : complex ndarray, w x n
        Eigenvalues of the oscillators, 1/s.
    shapes : ndarray, w x n x n
        ``x = shapes z``.
    force : ndarray, w x n x m x s
        Modal forces at the nodes.
    starts : complex ndarray, w x n x m
        Modal states at the starts of the steps.
    answers : complex ndarray, w x n x (s + 2) x s
        Responses to Legendre terms of the forces: see `responses`.
    """

    begin: Array
    h: Array
    steps: Array
    rates: Array
    shapes: Array
    force: Array
    starts: Array
    answers: Array

    def displacement(self, row: Array, timepts: Array) -> Array:
        """Return ``row x`` at times, k."""
        weights = row @ self.shapes / self.rates.imag
        window, step, elapsed, position = self.located(timepts)
        polynomials = np.einsum("wn,wnmj->wmj", weights, self._polynomials.imag)
        result: Array = legendre.legval(position, polynomials[window, step].T, tensor=False)
        rates, at = self.rates[window], (window, slice(None), step)
        size, angle = (np.abs(self.waves) * weights[..., None])[at], rates.imag * elapsed[:, None]
        angle += np.angle(self.waves)[at]
        if self.rates.real.any():
            size *= np.exp(rates.real * elapsed[:, None])
        result += np.einsum("kn,kn->k", np.sin(angle, out=angle), size)
        return result

    def at(self, timepts: Array) -> tuple[Array, Array, Array]:
        """Return modal coordinates and rates at times, and the rates of the free vibrations alone, k x n each."""
        window, step, elapsed, position = self.located(timepts)
        rates = self.rates[window]
        vibrating = self.waves[window, :, step] * turning(rates, elapsed[:, None])[..., 0]
        u = (
            legendre.legval(position[:, None], self._polynomials[window, :, step].transpose(2, 0, 1), tensor=False)
            + vibrating
        )
        return *coordinates(rates, u), coordinates(rates, vibrating)[1]

    def located(self, timepts: Array) -> tuple[Array, Array, Array, Array]:
        """Return window and step of each time, the time since the step began, and the position in it, from -1 to 1."""
        window = np.maximum(np.searchsorted(self.begin, timepts, side="right") - 1, 0)
        h, since = self.h[window], timepts - self.begin[window]
        step = np.clip((since / h).astype(int), 0, self.steps[window] - 1)
        elapsed = since - step * h
        return window, step, elapsed, 2.0 * elapsed / h - 1.0

    @cached_property
    def _by_force(self) -> Array:
        """Motion by the forces alone, as ``u`` at start, nodes and end of each step, w x n x m x (s + 2)."""
        return self.force @ gauss_method(self.force.shape[3]).terms.T @ self.answers.swapaxes(2, 3)

    @cached_property
    def _polynomials(self) -> Array:
        """Legendre coefficients of that, w x n x m x (s + 2)."""
        return self._by_force @ gauss_method(self.force.shape[3]).coefficients.T

    @cached_property
    def waves(self) -> Array:
        """Free vibrations at the beginning of each step, as ``u``, w x n x m."""
        return self.starts - self._by_force[..., 0]


class WindowMotion(NamedTuple):
    """Motion through a window, the hub free.

    Attributes
    ----------
    begin, h : float
        Start time of the window and length of its steps, s.
    modes : FreeModes
    fast : ndarray of bool, n
        True for modes whose vibrations are omitted in the forces.
    force : ndarray, (1 + n) x m x s
        Modal forces at the nodes.
    states : complex ndarray, (1 + n) x (m + 1)
        Modal states at the ends of the steps.
    """

    begin: float
    h: float
    modes: FreeModes
    fast: Array
    force: Array
    states: Array


@final
@dataclass(frozen=True, eq=False)
class FreeTrajectory:
    """Motion of hub and beam through windows, one after another.

    Attributes
    ----------
    form : FreeHubForm
    windows : sequence of WindowMotion
    """

    form: FreeHubForm
    windows: tuple[WindowMotion, ...]

    @property
    def steps(self) -> int:
        """Number of steps."""
        return int(self._vibrations.steps.sum())

    def displacement(self, row: Array, timepts: Array) -> Array:
        """Return ``row q`` at times, k."""
        return self._vibrations.displacement(row @ self.form.to_q, timepts)

    def __call__(self, timepts: Array) -> tuple[Array, Array]:
        """Return coordinates and rates of hub and beam at times, k x N each."""
        window, step, elapsed, position = self._vibrations.located(timepts)
        x, rate, turned = self._vibrations.at(timepts)
        start, force = (item[window, 0, step] for item in self._solved)
        h, stages = self._vibrations.h[window], force.shape[1]
        terms = force @ (gauss_method(stages).coefficients @ free_mass(1.0, stages)).T
        by_force = legendre.legval(position, terms.T, tensor=False)
        r = start.imag + elapsed * start.real + h * h * by_force.imag
        z, z_rate = np.column_stack([r, x]), np.column_stack([start.real + h * by_force.real, rate])
        for index, item in enumerate(self.windows):  # rates due to the fast vibrations, which the forces omit
            within = np.flatnonzero(window == index)
            if within.size and item.fast.any():
                vibrating = np.where(item.fast, turned[within], 0.0).T
                z_rate[within] -= item.modes.impulses(z[within].T, vibrating).T
        shapes = self._vibrations.shapes[window]
        beams = [(item[:, 0], np.einsum("kij,kj->ki", shapes, item[:, 1:])) for item in (z, z_rate)]
        y, y_rate = (
            np.column_stack([hub / np.sqrt(self.form.inertia) + x @ self.form.lean, x @ self.form.to_q.T])
            for hub, x in beams
        )
        return y, y_rate

    @cached_property
    def _solved(self) -> tuple[Array, Array]:
        """Modal states at the starts of the steps, forces at the nodes; zeros up to the most steps of a window."""
        size, _, stages = self.windows[0].force.shape
        most = max(item.force.shape[1] for item in self.windows)
        states = np.zeros((len(self.windows), size, most), dtype=complex)
        force = np.zeros((*states.shape, stages))
        for index, item in enumerate(self.windows):
            states[index, :, : item.force.shape[1]] = item.states[:, :-1]
            force[index, :, : item.force.shape[1]] = item.force
        return states, force

    @cached_property
    def _vibrations(self) -> Vibrations:
        begin, h, modes, _, force, _ = zip(*self.windows, strict=True)
        rates, (states, forces) = np.stack([item.rates[1:] for item in modes]), self._solved
        return Vibrations(
            begin=np.array(begin),
            h=np.array(h),
            steps=np.array([item.shape[1] for item in force]),
            rates=rates,
            shapes=np.stack([item.shapes for item in modes]),
            force=forces[:, 1:],
            starts=states[:, 1:],
            answers=responses(rates, np.array(h), forces.shape[-1], SMOOTH),
        )
