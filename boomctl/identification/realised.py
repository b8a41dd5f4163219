"""A modal model as a system: residues of rank one, what lies outside the band as feedthrough and a few fast states."""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.common_poles import CommonPoles
from boomctl.identification.spectra import Spectra, pairs, real
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
        Pairs that stand for modes outside the band.
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
        blocks = _columns(data, fit.poles, b, fit.fixed, rigid_b, fit.integrators)
        blocks += [data.free(fit.poles), data.ends(fit.integrators)]
        every = _coefficients(np.concatenate(blocks, axis=1), real(data.Y)) * data.scale
        found = np.split(every, np.cumsum([block.shape[1] for block in blocks]))
        k, f, p = len(fit.poles), len(fit.fixed), every.shape[1]
        c = found[0][:k] + 1j * found[0][k:]
        return cls(fit.poles, b, c, found[1], fit.fixed, found[2].reshape(f, 2, m, p), rigid_b, found[3])

    def predicted(self, data: Spectra) -> Array:
        """Return the responses of the outputs to the inputs, in the scale of the data, (2 n, p)."""
        blocks = _columns(data, self.poles, self.b, self.fixed, self.rigid_b, len(self.rigid_c))
        p = self.D.shape[1]
        parts = [self.c.real, self.c.imag, self.D, self.residues.reshape(-1, p), self.rigid_c]
        return np.concatenate(blocks, axis=1) @ np.concatenate(parts) / data.scale

    def left(self, data: Spectra) -> Array:
        """Return the errors of a free run from the best initial state of each record, (2 n, p).

        The initial state has one number for each state of the system, whatever the outputs.  In the spectrum its free
        motion and the motion at the end of the record are one: neither is limited by the other.
        """
        y = real(data.Y) - self.predicted(data)
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
        free = data.free(poles).reshape(len(y), len(poles), 2)
        ends = data.ends(len(self.rigid_c))
        edge = np.linalg.qr(ends / np.linalg.norm(ends, axis=0))[0]
        y = y - edge @ (edge.T @ y)
        if not len(poles):
            return y
        products, gradient = 0.0, 0.0
        columns = []
        for o, row in enumerate(c.T / data.scale[:, None]):
            # real part of (c d) / (q - p): d = d1 + j d2 are the unknowns
            first = free[:, :, 0] * row.real + free[:, :, 1] * row.imag
            second = free[:, :, 1] * row.real - free[:, :, 0] * row.imag
            own = np.concatenate([first, second], axis=1)
            own = own - edge @ (edge.T @ own)
            columns.append(own)
            products, gradient = products + own.T @ own, gradient + own.T @ y[:, o]
        size = np.sqrt(np.diagonal(products))
        size = np.where(size > ALIKE * size.max(), size, 1.0)
        state = linalg.lstsq(products / size / size[:, None], gradient / size, cond=ALIKE)[0] / size  # type: ignore[index]
        return y - np.column_stack([own @ state for own in columns])

    def system(self, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> Lti:
        """Return the system: two states a mode, one a real pole, two an input for each fixed pair, one an integrator."""
        m = len(inputs)
        outside = (self.residues[:, 0] + 1j * self.residues[:, 1]).reshape(-1, len(outputs))
        repeated = np.tile(np.eye(m), (len(self.fixed), 1))
        A, B, C, names = [], [], [], []
        rigid = len(self.rigid_c)
        if rigid:
            A.append(np.eye(rigid, k=-1))
            B.append(np.eye(rigid, 1) * self.rigid_b)
            C.append(self.rigid_c.T)
            names += ["rigid_velocity", "rigid_position"][:rigid] if rigid == 2 else ["integrator"]
        entries = [(f"mode_{k + 1}", *entry) for k, entry in enumerate(zip(self.poles, self.b, self.c, strict=True))]
        others = zip(np.repeat(self.fixed, m), repeated, outside, strict=True)
        entries += [(f"outside_{k + 1}", *entry) for k, entry in enumerate(others)]
        for name, pole, b, c in entries:
            if pole.imag == 0.0:
                A.append(np.array([[pole.real]]))
                B.append(b.real[None])
                C.append(2.0 * c.real[:, None])
                names.append(name.replace("mode", "real_pole"))
            else:
                A.append(np.array([[pole.real, -pole.imag], [pole.imag, pole.real]]))
                B.append(np.array([b.real, b.imag]))
                C.append(2.0 * np.column_stack([c.real, -c.imag]))
                names += [f"{name}_re", f"{name}_im"]
        empty = np.zeros((0, m)), np.zeros((len(outputs), 0))
        return Lti(
            linalg.block_diag(*A) if A else np.zeros((0, 0)),
            np.concatenate([empty[0], *B]),
            np.concatenate([empty[1], *C], axis=1),
            self.D.T.copy(),
            inputs,
            outputs,
            tuple(names),
        )

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
        columns = np.concatenate([*moved, data.free(self.poles), data.ends()], axis=1)
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


def _columns(data: Spectra, poles: Array, b: Array, fixed: Array, rigid_b: Array, integrators: int) -> list[Array]:
    """Return the columns of modes, of the feedthrough, of fixed pairs and of integrators."""
    forced = data.rest(fixed)[:, : data.U.shape[1] * (2 * len(fixed) + 1)]
    rigid = [real(response * (data.U @ rigid_b)) for response in data.integrated(integrators)]
    m = data.U.shape[1]
    return [
        _driven(data, poles, b),
        forced[:, :m],
        forced[:, m:],
        np.column_stack(rigid) if rigid else np.zeros((len(forced), 0)),
    ]


def _driven(data: Spectra, poles: Array, b: Array) -> Array:
    """Return columns of modes driven along one direction each: of real, then of imaginary parts of ``c``."""
    above = data.simple(poles)[0] * (b @ data.U.T)
    below = data.simple(poles.conj())[0] * (b.conj() @ data.U.T)
    return real(np.concatenate(pairs(above, below)).T)
