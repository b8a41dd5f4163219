"""Poles that all entries share, by least squares: residues are solved for, poles move by damped Gauss-Newton steps."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.spectra import Spectra, complex_of, real

_STEPS = 40  # Gauss-Newton steps of a fit: ten do where the start is near (a choice)
_DONE = 0.01  # fall of the sum of squares, in squared errors of one number, that ends them: a tenth of a standard error
_DAMPING = 1e-3  # of the curvature that is added at first (Marquardt)
_LEAST_DAMPING = 1e-6  # what is always added: rounding of the curvature stays far below
_GIVE_UP = 1e6  # damping at which no step falls: rounding
_FARTHEST = 1.0  # change of the logarithm of a decay rate, and of a frequency in rates, that a step may make (a choice)
_LEAST_DECAY = 1e-7  # of the frequency: slower decay than that is not told from none by any record
_FAST = (
    2.0  # times the highest frequency: where the modes above the band are put (a choice; 1.5 to 4 give the same fit)
)
_SLOW = 0.5  # times the lowest frequency: where those below it are put (likewise)
_AROUND = 10.0  # lines to either side at least that errors around a resonance are taken from (a choice)
_BLOCK = 64  # lines over which errors are taken for as large: a median of so many is known to a fifth (a choice)
_RANK = 1e-11  # of the largest singular value of columns of length one: less is rounding


def fixed_poles(low: float, high: float) -> Array:
    """Return where modes outside a band [rad/s] are put: one pair above, and one below if the band does not begin at zero."""
    at = [_FAST * high] + ([_SLOW * low] if low > 0.0 else [])
    return np.array(at) * (-1.0 + 1.0j) / np.sqrt(2.0)


@dataclass(frozen=True)
class CommonPoles:
    """Residues of given poles by least squares.

    Attributes
    ----------
    data : Spectra
    poles : (k,) ndarray
        One of each pair, with positive imaginary part [rad/s].
    fixed : ndarray
        Pairs outside the band that are not moved.
    """

    data: Spectra
    poles: Array
    fixed: Array

    @cached_property
    def _columns(self) -> tuple[Array, Array]:
        return self.data.pairs(self.poles)

    @cached_property
    def _solved(self) -> tuple[Array, Array, Array, Array]:
        """Return an orthonormal basis, the inverse that leads from it to coefficients, coefficients and residuals."""
        pairs = self._columns[0]
        columns = np.concatenate([pairs.reshape(len(pairs), -1), self.data.rest(self.fixed)], axis=1)
        size = np.linalg.norm(columns, axis=0)
        size[size == 0.0] = 1.0
        basis, upper = linalg.qr(columns / size, mode="economic", check_finite=False)[:2]
        inverse = linalg.pinv(upper, rtol=_RANK, check_finite=False) / size[:, None]
        y = real(self.data.Y)
        within = basis.T @ y
        return basis, inverse, inverse @ within, y - basis @ within

    @property
    def basis(self) -> Array:
        """Orthonormal columns of all that is linear, (2 n, c)."""
        return self._solved[0]

    @property
    def residuals(self) -> Array:
        """What is not explained, (2 n, p)."""
        return self._solved[3]

    @property
    def coefficients(self) -> Array:
        """Of the pairs' columns, (k, 2, m + records, p)."""
        pairs = self._columns[0]
        return self._solved[2][: pairs[0].size].reshape(*pairs.shape[1:], -1)

    @property
    def others(self) -> Array:
        """Coefficients of the columns beside the pairs."""
        return self._solved[2][self._columns[0][0].size :]

    @cached_property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(np.square(self.residuals).sum())

    @property
    def freedom(self) -> int:
        """Real equations of an output beyond its unknowns."""
        return max(len(self.residuals) - len(self._solved[2]), 1)

    @property
    def deviation(self) -> Array:
        """Deviation of the errors of each output, by the residuals, in units of ``data.Y``."""
        return np.sqrt(np.square(self.residuals).sum(axis=0) / self.freedom)

    @cached_property
    def errors(self) -> Array:
        """Mean squared error of each part of each number of ``data.Y``, (n, p): that of all or, where larger, that around it.

        Of the lines around the median is taken, which a mode that was missed hardly changes.
        """
        power = np.square(np.abs(complex_of(self.residuals))) * (0.5 * len(self.residuals) / self.freedom)
        floor = power.mean(axis=0) + np.finfo(float).tiny
        levels = np.empty_like(power)
        for k in range(len(self.data.lines)):
            rows = np.flatnonzero(self.data.record == k)
            blocks = np.array_split(power[rows], max(len(rows) // _BLOCK, 1))
            middle = np.array([np.median(block, axis=0) for block in blocks]) / np.log(2.0)
            centres = np.linspace(0.0, len(rows), 2 * len(blocks) + 1)[1::2]
            levels[rows] = np.array([np.interp(np.arange(len(rows)), centres, level) for level in middle.T]).T
        return np.maximum(levels, floor)

    @property
    def shares(self) -> Array:
        """What each pair adds by the inputs to each output's mean square, mean over the outputs."""
        m = self.data.U.shape[1]
        energy = np.square(np.abs(self.data.Y)).sum(axis=0)
        energy[energy == 0.0] = 1.0
        found = []
        for columns, answer in zip(self._columns[0].transpose(1, 0, 2, 3), self.coefficients, strict=True):
            moved = columns[..., :m].reshape(len(columns), -1) @ answer[:, :m].reshape(2 * m, -1)
            found.append((np.square(moved).sum(axis=0) / energy).mean())
        return np.array(found)

    @property
    def evidence(self) -> Array:
        """By how much the sum of squares, in units of the errors, rises where the inputs no longer move a pair.

        Errors are those around the resonance.
        """
        _, inverse, _, _ = self._solved
        m, size = self.data.U.shape[1], self._columns[0][0, 0].size
        width = _AROUND * self.data.resolution
        around = 1.0 / (np.square(np.abs(self.data.s[:, None] - self.poles)) + width**2)
        errors = (around / around.sum(axis=0)).T @ self.errors
        found = []
        for k, answer in enumerate(self.coefficients):
            rows = (k * size + np.arange(size).reshape(2, -1)[:, :m]).ravel()
            spread = inverse[rows] @ inverse[rows].T
            c = answer[:, :m].reshape(2 * m, -1)
            found.append(float((c * (linalg.pinv(spread, check_finite=False) @ c) / errors[k]).sum()))
        return np.array(found)

    @cached_property
    def slopes(self) -> tuple[Array, Array]:
        """Derivatives of the model, residues solved for: columns (2 n, k, w), and what they are multiplied by (k, 2, w, p).

        For the logarithm of each pole's decay rate, and for its frequency in units of that rate.
        """
        basis = self._solved[0]
        derived = self._columns[1].reshape(len(self.residuals), -1)
        free = derived - basis @ (basis.T @ derived)
        c = self.coefficients
        k, w = len(c), c[0].size // c.shape[3] if len(c) else 0
        decay = c.reshape(k, w, -1)
        swing = np.stack([-c[:, 1], c[:, 0]], axis=1).reshape(k, w, -1)
        rate = self.poles.real[:, None, None]
        return free.reshape(len(free), k, w), np.stack([rate * decay, -rate * swing], axis=1)

    def moved(self, step: Array) -> "CommonPoles":
        """Return the same at other poles: steps of logarithms of rates and of frequencies in rates, (k, 2)."""
        rate = -self.poles.real
        frequency = np.abs(self.poles.imag + rate * step[:, 1])
        decay = np.maximum(rate * np.exp(step[:, 0]), _LEAST_DECAY * frequency)
        return CommonPoles(self.data, -decay + 1j * frequency, self.fixed)

    @cached_property
    def normal_equations(self) -> tuple[Array, Array]:
        """Curvature (2 k, 2 k) and downward slope (2 k,) of half the sum of squares over the steps."""
        columns, factors = self.slopes
        k, w = columns.shape[1:]
        flat = columns.reshape(len(columns), -1)
        products = (flat.T @ flat).reshape(k, w, k, w)
        curvature = np.einsum("aivo,avbw,bjwo->aibj", factors, products, factors, optimize=True)
        downward = np.einsum("aiwo,awo->ai", factors, (flat.T @ self.residuals).reshape(k, w, -1))
        return curvature.reshape(2 * k, 2 * k), downward.ravel()


def fitted(start: CommonPoles, steps: int = _STEPS) -> CommonPoles:
    """Return the least squares over the poles too, or what so many steps towards it give."""
    here, damping = start, _DAMPING
    if not len(here.poles):
        return here
    for _ in range(steps):
        curvature, downward = here.normal_equations
        size = np.sqrt(np.diagonal(curvature))
        size = np.maximum(size, np.finfo(float).eps * size.max() + np.finfo(float).tiny)
        curvature, downward = curvature / size / size[:, None], downward / size
        while True:
            damped = curvature + damping * np.eye(len(size))
            step = linalg.solve(damped, downward, assume_a="pos", check_finite=False) / size
            step *= min(1.0, _FARTHEST / max(np.abs(step).max(), np.finfo(float).tiny))
            there = here.moved(step.reshape(-1, 2))
            if there.cost < here.cost or damping > _GIVE_UP:
                break
            damping *= 10.0
        if there.cost >= here.cost:
            return here
        fall = (1.0 - there.cost / here.cost) * here.residuals.size
        here, damping = there, max(damping / 10.0, _LEAST_DAMPING)
        if fall < _DONE:
            break
    return here
