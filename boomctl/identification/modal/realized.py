"""A modal model as a system: residues of rank one, modes outside the band as feedthrough and a few pairs of poles."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.modal.common_poles import CommonPoles, least_squares, root_of_inverse
from boomctl.identification.modal.modal_structure import modal_structure
from boomctl.identification.modal.spectra import Spectra, complex_of, pairs, real, rms
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import Lti
from boomctl.structure.model import SecondOrderModel


@dataclass(frozen=True)
class RankOne:
    """Modes that each input reaches by one number and each output shows by one: ``c b^T / (s - p)`` and its conjugate.

    Attributes
    ----------
    poles : (k,) ndarray
        One of each pair, with positive imaginary part, or a real pole [rad/s].
    b : (k, m) ndarray
        Complex, of length one.
    c : (k, p) ndarray
        Of a real pole half of what the output reads.
    D : (m, p) ndarray
    fixed : ndarray
        Pairs that represent modes outside the band.
    residues : (f, 2, m, p) ndarray
        Their residues, real and imaginary parts.
    rigid_b : (m,) ndarray
        Of the integrators.
    rigid_c : (0, 1 or 2, p) ndarray
        What the outputs read of one integrator, and of two in series.
    """

    poles: Array
    b: Array
    c: Array
    D: Array
    fixed: Array
    residues: Array
    rigid_b: Array
    rigid_c: Array

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
        integrated = data.integrated(fit.integrators)
        rigid_b = np.zeros(m)
        if integrated:
            last = len(fit.fixed) * 2 * m + m
            of_rest = fit.of_rest[last : last + m * fit.integrators].reshape(fit.integrators, m, -1)
            size = np.array([np.linalg.norm(response[:, None] * data.U) for response in integrated])
            weighted = size[:, None, None] * power[:, None] * of_rest
            rigid_b = np.linalg.svd(weighted.transpose(1, 0, 2).reshape(m, -1))[0][:, 0] / power
            rigid_b /= np.linalg.norm(rigid_b)
        return cls._of_directions(data, fit.poles, b, fit.fixed, rigid_b, fit.integrators)

    @classmethod
    def _of_directions(
        cls, data: Spectra, poles: Array, b: Array, fixed: Array, rigid_b: Array, integrators: int
    ) -> "RankOne":
        """Return the model with these directions of the inputs, all that is linear by least squares."""
        blocks = _columns(data, poles, b, fixed, rigid_b, integrators)
        blocks += [data.free(poles), data.ends(integrators)]
        rows = np.concatenate(blocks, axis=1).T
        every = least_squares(rows, root_of_inverse(rows @ rows.T), real(data.Y))[0] * data.scale
        result = np.split(every, np.cumsum([block.shape[1] for block in blocks]))
        k, f, m, p = len(poles), len(fixed), b.shape[1], every.shape[1]
        c = result[0][:k] + 1j * result[0][k:]
        return cls(poles, b, c, result[1], fixed, result[2].reshape(f, 2, m, p), rigid_b, result[3])

    def with_real_directions(self, data: Spectra, loss: float) -> "RankOne":
        """Return the model with real ``b``, where that raises the error of no output by more than a percentage; else itself.

        A mode with real ``b`` is one coordinate of a structure, and two otherwise.
        """
        if self.b.shape[1] == 1:  # The phase of b is that of c.
            return self
        straight = self._of_directions(
            data, self.poles, self.b.real.astype(complex), self.fixed, self.rigid_b, len(self.rigid_c)
        )
        before, after = (rms(complex_of(model.left(data))) / rms(data.Y) for model in (self, straight))
        return straight if 100.0 * (after - before).max() <= loss else self

    def left(self, data: Spectra) -> Array:
        """Return the errors of a free run from the best initial state of each record, (2 n, p).

        The initial state has one number for each state of the system. In the spectrum its free
        motion and the motion at the end of the record are one: neither is limited by the other.
        """
        blocks = _columns(data, self.poles, self.b, self.fixed, self.rigid_b, len(self.rigid_c))
        parts = [self.c.real, self.c.imag, self.D, self.residues.reshape(-1, self.D.shape[1]), self.rigid_c]
        y = real(data.Y) - np.concatenate(blocks, axis=1) @ np.concatenate(parts) / data.scale
        for k in range(data.records):
            rows = np.flatnonzero(np.repeat(data.record == k, 2))
            y[rows] = self._free_run(data.of_record_number(k), y[rows])
        return y

    def _free_run(self, data: Spectra, y: Array) -> Array:
        """Return the errors of one record less free motions of one initial state, and what its ends leave."""
        m = len(self.D)
        poles = np.concatenate([self.poles, np.repeat(self.fixed, m)])
        outside = (self.residues[:, 0] + 1j * self.residues[:, 1]).reshape(-1, y.shape[1])
        c = np.concatenate([self.c, outside])
        ends = data.ends(len(self.rigid_c))
        edge = np.linalg.qr(ends / np.linalg.norm(ends, axis=0))[0]
        y = y - edge @ (edge.T @ y)
        if not len(poles):
            return y
        free = data.free(poles).reshape(len(y), len(poles), 2).swapaxes(1, 2).reshape(len(y), -1)
        free = free - edge @ (edge.T @ free)
        # real part of (c d) / (q - p): d = d1 + j d2 are the unknowns
        rows = c.T / data.scale[:, None]
        shapes = [np.block([[np.diag(r.real), -np.diag(r.imag)], [np.diag(r.imag), np.diag(r.real)]]) for r in rows]
        products, gradients = free.T @ free, free.T @ y
        total = sum(shape.T @ products @ shape for shape in shapes)
        gradient = sum(shape.T @ column for shape, column in zip(shapes, gradients.T, strict=True))
        size = np.sqrt(np.diagonal(total))
        size = np.where(size > ALIKE * size.max(), size, 1.0)
        state = linalg.lstsq(total / size / size[:, None], gradient / size, cond=ALIKE)[0] / size  # type: ignore[index]
        return y - free @ np.column_stack([shape @ state for shape in shapes])

    @property
    def _pairs(self) -> tuple[Array, Array, Array]:
        """Poles of modes, and the fixed pairs once for each input, with their ``b`` and ``c``."""
        m, p = self.D.shape
        mode = self.poles.imag > 0.0
        poles = np.concatenate([self.poles[mode], np.repeat(self.fixed, m)])
        b = np.concatenate([self.b[mode], np.tile(np.eye(m), (len(self.fixed), 1))])
        outside = (self.residues[:, 0] + 1j * self.residues[:, 1]).reshape(-1, p)
        return poles, b, np.concatenate([self.c[mode], outside])

    @property
    def _real(self) -> tuple[Array, Array, Array]:
        """Real poles with their ``b`` and ``c``."""
        real = self.poles.imag == 0.0
        return self.poles[real].real, self.b[real].real, 2.0 * self.c[real].real

    def system(self, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Lti:
        """Return the system: two states a mode, one a real pole, two an input for each fixed pair, one an integrator."""
        poles, b, c = self._pairs
        decays, entries, rows = self._real
        m, modes, rigid = len(inputs), int((self.poles.imag > 0.0).sum()), len(self.rigid_c)
        turns = [np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]) for pole in poles]
        names = [f"mode_{k + 1}" if k < modes else f"outside_{k - modes + 1}" for k in range(len(poles))]
        states = [f"{name}_{part}" for name in names for part in ("re", "im")]
        states += [f"real_pole_{k + 1}" for k in range(len(decays))]
        states += [f"integrator_{k + 1}" for k in range(rigid)]
        A = linalg.block_diag(*turns, np.diag(decays), np.eye(rigid, k=-1))
        B = np.concatenate(
            [np.stack([b.real, b.imag], axis=1).reshape(-1, m), entries, np.eye(rigid, 1) * self.rigid_b]
        )
        C = np.concatenate([2.0 * np.stack([c.real, -c.imag], axis=1).reshape(-1, len(outputs)), rows, self.rigid_c])
        return Lti(A, B, C.T.copy(), self.D.T.copy(), inputs, outputs, tuple(states))

    def structure(
        self, inputs: tuple[str, ...], outputs: tuple[str, ...], derivatives: tuple[int, ...]
    ) -> SecondOrderModel:
        """Return the structure of the same transfer function, whose forces are the inputs."""
        decays, entries, rows = self._real
        residues = entries[:, :, None] * rows[:, None, :]
        double = None
        if len(self.rigid_c):
            single, *twice = self.rigid_b[:, None] * self.rigid_c[:, None, :]
            decays, residues = np.append(decays, 0.0), np.concatenate([residues, single[None]])
            double = twice[0] if twice else None
        return modal_structure(
            *self._pairs,
            self.D.T,
            inputs,
            outputs,
            derivatives=derivatives,
            modes=int((self.poles.imag > 0.0).sum()),
            real_poles=decays,
            real_residues=residues,
            double_residue=double,
        )


def _columns(data: Spectra, poles: Array, b: Array, fixed: Array, rigid_b: Array, integrators: int) -> list[Array]:
    """Return the columns of modes (real, then imaginary parts of ``c``), feedthrough, fixed pairs and integrators."""
    forced = data.rest(fixed)[:, : data.U.shape[1] * (2 * len(fixed) + 1)]
    rigid = [real(response * (data.U @ rigid_b)) for response in data.integrated(integrators)]
    m = data.U.shape[1]
    above = data.simple(poles)[0] * (b @ data.U.T)
    below = data.simple(poles.conj())[0] * (b.conj() @ data.U.T)
    return [
        real(np.concatenate(pairs(above, below)).T),
        forced[:, :m],
        forced[:, m:],
        np.column_stack(rigid) if rigid else np.zeros((len(forced), 0)),
    ]
