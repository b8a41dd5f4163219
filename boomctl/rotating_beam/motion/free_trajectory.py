"""A torque-driven motion between the nodes of its windows: a polynomial and a vibration of each mode on every step."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.polynomial import legendre

from boomctl.arrays import Array
from boomctl.gauss import gauss_method
from boomctl.rotating_beam.modal.equations import FreeHubForm
from boomctl.rotating_beam.motion.free_modes import FreeModes
from boomctl.rotating_beam.motion.oscillators import Oscillators, responses

_SMOOTH = 3.0  # phase in a step up to which a polynomial through the nodes is the motion: to 1e-10 of what forces do


class Piece(NamedTuple):
    """Motion through a window.

    Attributes
    ----------
    begin, h : float
        Beginning and length of a step, s.
    modes : FreeModes
    fast : ndarray of bool, n
        Whose vibrations the forces do not know of.
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
    pieces : sequence of Piece
    """

    form: FreeHubForm
    pieces: Sequence[Piece]

    @property
    def steps(self) -> int:
        """Number of steps."""
        return sum(piece.force.shape[1] for piece in self.pieces)

    def displacement(self, row: Array, timepts: Array) -> Array:
        """``row q`` at instants, k."""
        weights = ((row @ self.form.to_q)[None, None] @ self._shapes)[:, 0]
        window, step, elapsed, place = self._placed(timepts)
        windows, _, steps, stages = self._force.shape
        by_force = (weights[..., None, None] * self._answers[0][:, 1:]).swapaxes(1, 2).reshape(windows, stages + 2, -1)
        force = self._force[:, 1:].swapaxes(1, 2).reshape(windows, steps, -1)
        result: Array = np.einsum("kj,kj->k", place, (force @ by_force.swapaxes(1, 2))[window, step])
        waves = (weights / self._oscillators.omega)[..., None] * self._waves
        result += self._vibrations(window, step, elapsed, waves).imag.sum(axis=1)
        return result

    def __call__(self, timepts: Array) -> tuple[Array, Array]:
        """Coordinates and rates of hub and beam at instants, k x N each."""
        window, step, elapsed, place = self._placed(timepts)
        z, rate = (np.einsum("kj,kij->ki", place, terms[window, :, step]) for terms in self._terms)
        start = np.stack([piece.states[0, :-1] for piece in self.pieces])[window, step]
        z[:, 0] += np.imag(start) + elapsed * np.real(start)
        rate[:, 0] += np.real(start)
        sigma, omega, _ = self._oscillators.take(window)
        free = self._vibrations(window, step, elapsed, self._waves)
        moved = free.imag / omega
        turned = free.real - sigma * moved
        z[:, 1:] += moved
        rate[:, 1:] += turned
        rate += self._carried(window, z, turned)
        return self._physical(z, window), self._physical(rate, window)

    def _carried(self, window: Array, z: Array, turned: Array) -> Array:
        """Rates by which hub and slow modes are moved to and fro by the vibrations that the forces do not know of."""
        result = np.zeros_like(z)
        for index, piece in enumerate(self.pieces):
            within = np.flatnonzero(window == index)
            if within.size and piece.fast.any():
                begun = np.where(piece.fast, turned[within], 0.0).T
                result[within] = -piece.modes.impulses(z[within].T[None], begun[None])[0].T
        return result

    def _physical(self, z: Array, window: Array) -> Array:
        x = np.einsum("kij,kj->ki", self._shapes[window], z[:, 1:])
        theta = z[:, 0] / np.sqrt(self.form.inertia) + x @ self.form.lean
        return np.column_stack([theta, x @ self.form.to_q.T])

    def _vibrations(self, window: Array, step: Array, elapsed: Array, waves: Array) -> Array:
        """Free vibrations at instants in their windows and steps, k x n, complex."""
        return waves[window, :, step] * self._oscillators.take(window).turning(elapsed)

    def _placed(self, timepts: Array) -> tuple[Array, Array, Array, Array]:
        """Window and step in which each instant lies, the time since its step began, and Legendre's polynomials there."""
        window = np.maximum(np.searchsorted(self._begin, timepts, side="right") - 1, 0)
        h, since = self._h[window], timepts - self._begin[window]
        step = np.clip((since / h).astype(int), 0, self._force.shape[2] - 1)
        elapsed = since - step * h
        return window, step, elapsed, legendre.legvander(2.0 * elapsed / h - 1.0, self._force.shape[3] + 1)

    @cached_property
    def _begin(self) -> Array:
        return np.array([piece.begin for piece in self.pieces])

    @cached_property
    def _h(self) -> Array:
        return np.array([piece.h for piece in self.pieces])

    @cached_property
    def _shapes(self) -> Array:
        return np.concatenate([piece.modes.shapes for piece in self.pieces])

    @cached_property
    def _oscillators(self) -> Oscillators:
        item = [piece.modes.oscillators for piece in self.pieces]
        sigma, omega = (np.concatenate([getattr(one, name) for one in item]) for name in ("sigma", "omega"))
        return Oscillators(sigma, omega, bool(self.form.decay))

    @cached_property
    def _force(self) -> Array:
        return np.stack([piece.force for piece in self.pieces])

    @cached_property
    def _responses(self) -> Array:
        return responses(self._oscillators, self._h, self._force.shape[3], _SMOOTH)

    @cached_property
    def _answers(self) -> tuple[Array, Array]:
        """Legendre coefficients of coordinates and rates by the forces, windows x (1 + n) x (s + 2) x s."""
        to_terms = gauss_method(self._force.shape[3]).coefficients
        z, rate = self._oscillators.coordinates(self._responses)
        return to_terms @ z, to_terms @ rate

    @cached_property
    def _terms(self) -> tuple[Array, Array]:
        """Legendre coefficients of the motion by the forces alone, windows x (1 + n) x m x (s + 2)."""
        z, rate = (self._force @ answers.swapaxes(2, 3) for answers in self._answers)
        return z, rate

    @cached_property
    def _waves(self) -> Array:
        """Free vibrations at the beginning of each step, as ``u``, windows x n x m."""
        waves: Array = np.stack([piece.states[1:, :-1] for piece in self.pieces])
        begun = self._responses[:, 1:, 0]
        return waves - (self._force[:, 1:] @ begun[..., None])[..., 0]
