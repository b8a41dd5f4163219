"""A modal model as a system: residues of rank one, what lies outside the band as feedthrough and a few fast states."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.common_poles import CommonPoles
from boomctl.identification.spectra import Spectra, pairs, real
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class RankOne:
    """Modes that each input reaches by one number and each output shows by one: ``c b^T / (s - p)`` and its conjugate.

    Attributes
    ----------
    poles : (k,) ndarray
    b : (k, m) ndarray
        Complex, of length one.
    c : (k, p) ndarray
    D : (m, p) ndarray
    fixed : ndarray
        Pairs that stand for modes outside the band.
    residues : (f, 2, m, p) ndarray
        Their residues, real and imaginary parts.
    """

    poles: Array
    b: Array
    c: Array
    D: Array
    fixed: Array
    residues: Array

    @classmethod
    def of(cls, fit: CommonPoles) -> "RankOne":
        """Return the nearest one: directions of inputs from residues, all that is linear by least squares once more."""
        data, m = fit.data, fit.data.U.shape[1]
        power = np.sqrt(np.square(np.abs(data.U)).mean(axis=0))
        b = np.zeros((len(fit.poles), m), complex)
        for k, (first, second) in enumerate(fit.coefficients[:, :, :m]):
            direction = np.linalg.svd(power[:, None] * (first + 1j * second))[0][:, 0] / power
            angle = 0.5 * np.angle(np.square(direction).sum())  # as real as it can be
            b[k] = direction * np.exp(-1j * angle) / np.linalg.norm(direction)
        columns = np.concatenate([_driven(data, fit.poles, b), data.rest(fit.fixed), data.free(fit.poles)], axis=1)
        found = _coefficients(columns, real(data.Y)) * data.scale
        k, f = len(fit.poles), len(fit.fixed)
        c = found[:k] + 1j * found[k : 2 * k]
        D, residues = found[2 * k : 2 * k + m], found[2 * k + m : 2 * k + m + 2 * f * m]
        return cls(fit.poles, b, c, D, fit.fixed, residues.reshape(f, 2, m, found.shape[1]))

    def predicted(self, data: Spectra) -> Array:
        """Return what the inputs make of the outputs, in the scale of the data, (2 n, p)."""
        parts = np.concatenate([self.c.real, self.c.imag, self.D, self.residues.reshape(-1, self.D.shape[1])])
        rest = data.rest(self.fixed)[:, : len(parts) - 2 * len(self.c)]
        return np.concatenate([_driven(data, self.poles, self.b), rest], axis=1) @ parts / data.scale

    def left(self, data: Spectra) -> Array:
        """Return what is not predicted but by free motions and ends of the record, (2 n, p)."""
        y = real(data.Y) - self.predicted(data)
        columns = np.concatenate([data.free(self.poles), data.ends], axis=1)
        return y - columns @ _coefficients(columns, y)

    def system(self, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Lti:
        """Return the system, two states a mode and two an input for each fixed pair."""
        m = len(inputs)
        poles = np.concatenate([self.poles, np.repeat(self.fixed, m)])
        b = np.concatenate([self.b, np.tile(np.eye(m), (len(self.fixed), 1))])
        outside = (self.residues[:, 0] + 1j * self.residues[:, 1]).reshape(-1, len(outputs))
        c = np.concatenate([self.c, outside])
        n = 2 * len(poles)
        A, B, C = np.zeros((n, n)), np.zeros((n, m)), np.zeros((len(outputs), n))
        for k, pole in enumerate(poles):
            two = slice(2 * k, 2 * k + 2)
            A[two, two] = [[pole.real, -pole.imag], [pole.imag, pole.real]]
            B[two] = b[k].real, b[k].imag
            C[:, two] = 2.0 * np.column_stack([c[k].real, -c[k].imag])
        names = [f"mode_{k + 1}" for k in range(len(self.poles))]
        names += [f"outside_{k + 1}" for k in range(len(poles) - len(self.poles))]
        return Lti(A, B, C, self.D.T.copy(), inputs, outputs, tuple(f"{n}_{x}" for n in names for x in ("re", "im")))

    def structure(
        self, data: Spectra, inputs: tuple[str, ...], outputs: tuple[str, ...]
    ) -> tuple[SecondOrderModel, Array]:
        """Return a structure whose forces are the inputs, by real modes, and what of the data it leaves.

        Coordinates are those of the modes, of mass one, and one of each input that is so fast that it follows at once.
        """
        square, rate = np.square(np.abs(self.poles)), -2.0 * self.poles.real
        b = self.b.real
        gain = 1.0 / (np.square(data.s)[:, None] + rate * data.s[:, None] + square)
        if data.held:  # of the same poles: the sampled response of 1/(s^2 + ...)
            pair = data.simple(self.poles)[0], data.simple(self.poles.conj())[0]
            gain = ((pair[0] - pair[1]) / (2j * self.poles.imag[:, None])).T
        moved = real(gain * (data.U @ b.T)), real(data.U)
        columns = np.concatenate([*moved, data.free(self.poles), data.ends], axis=1)
        y = real(data.Y)
        found = _coefficients(columns, y)
        left = y - columns @ found
        k, m = len(self.poles), len(inputs)
        fast = 10.0 * data.top  # its motion is within a hundredth of the static one (a choice)
        K = np.concatenate([square, np.full(m, fast**2)])
        C = np.concatenate([rate, np.full(m, 2.0 * fast)])
        forces = np.concatenate([b, np.eye(m) * fast**2])
        rows = found[: k + m] * data.scale
        model = SecondOrderModel(
            np.eye(k + m),
            np.diag(C),
            np.diag(K),
            dict(zip(inputs, forces.T, strict=True)),
            dict(zip(outputs, rows.T, strict=True)),
            [f"mode_{j + 1}" for j in range(k)] + [f"static_{name}" for name in inputs],
        )
        return model, left


def _coefficients(columns: Array, y: Array) -> Array:
    """Return the coefficients of columns of any size by least squares."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    return linalg.lstsq(columns / size, y)[0] / size[:, None]  # type: ignore[index]


def _driven(data: Spectra, poles: Array, b: Array) -> Array:
    """Return columns of modes driven along one direction each: of real, then of imaginary parts of ``c``."""
    above = data.simple(poles)[0] * (b @ data.U.T)
    below = data.simple(poles.conj())[0] * (b.conj() @ data.U.T)
    return real(np.concatenate(pairs(above, below)).T)
