"""Common poles of all entries by least squares: residues are solved for, poles move by damped Gauss-Newton steps."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg

from boomctl.arrays import Array
from boomctl.identification.modal.spectra import Spectra, complex_of, real

_STEPS = 40  # Most Gauss-Newton steps of a fit; ten suffice from a close start.
# Fall of the sum of squares, in squared errors of one number, that ends them, also if it is only expected of a step: a
# third of a standard error.
_DONE = 0.1
_DAMPING = 1e-3  # of the curvature that is added at first (Marquardt)
_LEAST_DAMPING = 1e-6  # what is always added: rounding of the curvature stays far below
_GIVE_UP = 1e6  # damping at which no step falls: rounding
_FARTHEST = 1.0  # Largest change in a step of the logarithm of a decay rate, and of a frequency over the rate.
_LEAST_DECAY = 1e-7  # Smallest decay rate relative to the frequency; a record does not determine smaller ones.
_FAST = 2.0  # Frequency of the modes above the band over its upper end; 1.5 to 4 give the same fit.
_AROUND = 10.0  # Fewest lines on either side of a resonance from which its errors are estimated.
_BLOCK = 64  # Lines over which errors count as equally large: their median is accurate to a fifth.
_RESONANCES = 3  # Resonances from which the error of the model is known.
_PEAK = 2.0  # Lines to either side of a resonance at least, from which it is computed.
_CLEAN = 1e-6  # of the energy of the outputs: of residuals that have more, rounding of products is a negligible part


def fixed_poles(low: float, high: float) -> Array:
    """Return where modes outside a band [rad/s] are put: one pair above, and one below if the band does not begin at zero."""
    return np.append(_FAST * high, low / _FAST if low > 0.0 else []) * (-1.0 + 1.0j) / np.sqrt(2.0)


@dataclass(frozen=True)
class CommonPoles:
    """Residues of given poles by least squares.

    Attributes
    ----------
    data : Spectra
    poles : (k,) ndarray
        One of each pair, with positive imaginary part, or a real pole [rad/s].
    fixed : ndarray
        Pairs outside the band that are not moved.
    integrators : int
        Integrators in series, 2 for a rigid body that a force moves.
    """

    data: Spectra
    poles: Array
    fixed: Array
    integrators: int = 0

    @cached_property
    def _rest(self) -> Array:
        return self.data.rest(self.fixed, self.integrators).T

    @cached_property
    def _responses(self) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        return self.data.simple(self.poles), self.data.simple(self.poles.conj())

    @cached_property
    def _rows(self) -> Array:
        """Columns of what is linear as rows (r, 2 n), pairs first."""
        return np.concatenate([self.data.rows(*self._responses, derived=False), self._rest])

    @cached_property
    def _derived(self) -> Array:
        """Derivatives of the pairs' columns by the poles as rows (q, 2 n)."""
        return self.data.rows(*self._responses, derived=True)

    @property
    def _width(self) -> int:
        """Number of columns of a response: inputs and free motions."""
        return self.data.U.shape[1] + self.data.records

    @cached_property
    def _products(self) -> Array:
        return self._rows @ self._rows.T

    @cached_property
    def _root(self) -> Array:
        """Of the inverse of the products of what is linear, (r, c)."""
        return root_of_inverse(self._products)

    @cached_property
    def _solved(self) -> tuple[Array, Array]:
        """Return coefficients and residuals."""
        return least_squares(self._rows, self._root, real(self.data.Y))

    @cached_property
    def basis(self) -> Array:
        """Orthonormal columns of all that is linear, (2 n, r)."""
        return (self._root.T @ self._rows).T

    @property
    def residuals(self) -> Array:
        """Residuals, (2 n, p)."""
        return self._solved[1]

    @property
    def coefficients(self) -> Array:
        """Of the pairs' columns, (k, 2, m + records, p)."""
        result = self._solved[0]
        return result[: len(result) - len(self._rest)].reshape(len(self.poles), 2, self._width, result.shape[1])

    def alone(self, k: int, low: float, high: float) -> Spectra:
        """Return the data from low to high [rad/s], less all that is not the response and free motions of one pole."""
        window, own = self.data.within(low, high), slice(2 * self._width * k, 2 * self._width * (k + 1))
        inside = np.repeat((self.data.s.imag >= low) & (self.data.s.imag <= high), 2)
        left = self.residuals[inside] + self._rows[own, inside].T @ self._solved[0][own]
        return replace(window, Y=complex_of(left))

    @property
    def of_rest(self) -> Array:
        """Coefficients of the columns other than those of the poles, (r, p)."""
        result = self._solved[0]
        return result[len(result) - len(self._rest) :]

    @cached_property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(np.square(self.residuals).sum())

    @property
    def dof(self) -> int:
        """Real equations of an output beyond its unknowns."""
        return max(len(self.residuals) - len(self._solved[0]), 1)

    @property
    def deviation(self) -> Array:
        """Deviation of the errors of each output, by the residuals, in units of ``data.Y``."""
        return np.sqrt(np.square(self.residuals).sum(axis=0) / self.dof)

    @cached_property
    def errors(self) -> Array:
        """Mean squared error of each part of each number of ``data.Y``, (n, p): the largest of three.

        These are the mean, the median of the lines around, which a mode that is not in the fit does not change, and the
        error of the model: a fraction of the response, as large as under most of the resonances.
        """
        power = np.square(np.abs(complex_of(self.residuals))) * (0.5 * len(self.residuals) / self.dof)
        floor = power.mean(axis=0) + np.finfo(float).tiny
        levels = np.empty_like(power)
        for k, lines in enumerate(self.data.lines):
            rows, size = np.flatnonzero(self.data.record == k), min(_BLOCK, len(lines))
            begin = np.linspace(0, len(rows) - size, max(len(rows) // size, 2)).astype(int)
            middle = np.median(power[rows[begin[:, None] + np.arange(size)]], axis=1) / np.log(2.0)
            position = np.interp(np.arange(len(rows)), begin + 0.5 * size, np.arange(len(begin)))[:, None]
            left = np.minimum(position.astype(int), len(begin) - 2)
            levels[rows] = middle[left[:, 0]] + (position - left) * (middle[left[:, 0] + 1] - middle[left[:, 0]])
        return np.maximum(np.maximum(levels, floor), 0.5 * self._model_error * np.square(np.abs(self._response)))

    @property
    def _response(self) -> Array:
        """Response of the fit, (n, p)."""
        return self.data.Y - complex_of(self.residuals)

    @property
    def _model_error(self) -> float:
        """Squared error over the squared response under a resonance: the median over resonances, of three and more."""
        poles = self.poles[self.poles.imag > 0.0]
        if len(poles) < _RESONANCES:
            return 0.0
        near = np.abs(self.data.s.imag[:, None] - poles.imag) < np.maximum(-poles.real, _PEAK * self.data.resolution)
        error, response = (
            near.T @ np.square(np.abs(values)).sum(axis=1) for values in (complex_of(self.residuals), self._response)
        )
        return float(np.median(error / np.maximum(response, np.finfo(float).tiny)))

    @property
    def energy_fractions(self) -> Array:
        """Contribution of each pair to the mean square of the outputs, by the inputs, mean over the outputs."""
        m = self.data.U.shape[1]
        energy = np.square(np.abs(self.data.Y)).sum(axis=0)
        energy[energy == 0.0] = 1.0
        result = []
        for rows, answer in zip(self._of_inputs, self.coefficients[:, :, :m], strict=True):
            products, c = self._products[np.ix_(rows, rows)], answer.reshape(2 * m, -1)
            result.append(((c * (products @ c)).sum(axis=0) / energy).mean())
        return np.array(result)

    @property
    def _of_inputs(self) -> Array:
        """Which of the linear columns are the answers of a pair to the inputs, (k, 2 m)."""
        m = self.data.U.shape[1]
        pairs = np.arange(2 * len(self.poles) * self._width).reshape(len(self.poles), 2, self._width)
        return pairs[:, :, :m].reshape(len(self.poles), 2 * m)

    @property
    def errors_around(self) -> Array:
        """Of `errors` the mean around the resonance of each pole, (k, p)."""
        width = _AROUND * self.data.resolution
        around = 1.0 / (np.square(np.abs(self.data.s[:, None] - self.poles)) + width**2)
        return (around / around.sum(axis=0)).T @ self.errors

    @property
    def evidence(self) -> Array:
        """By how much the sum of squares, in units of the errors, rises where the inputs no longer move a pair.

        Errors are those around the resonance.
        """
        m, errors, result = self.data.U.shape[1], self.errors_around, []
        for k, (rows, answer) in enumerate(zip(self._of_inputs, self.coefficients[:, :, :m], strict=True)):
            spread, c = self._root[rows] @ self._root[rows].T, answer.reshape(2 * m, -1)
            result.append(float((c * (linalg.pinv(spread, check_finite=False) @ c) / errors[k]).sum()))
        return np.array(result)

    @cached_property
    def over_time(self) -> tuple[Array, ...]:
        """`basis` and `residuals` over time, of each record."""
        return self.data.over_time(np.concatenate([self.basis.T, self.residuals.T]).T)

    @cached_property
    def derivatives_over_time(self) -> tuple[Array, ...]:
        """Derivatives by each pole without what all columns explain of them, over time, of each record."""
        derived, basis = self._derived, self.basis.T
        return self.data.over_time((derived - (derived @ basis.T) @ basis).T)

    @property
    def factors(self) -> Array:
        """Factors of these derivatives for the logarithm of each decay rate and for frequency over rate, (k, 2, w, p)."""
        c = self.coefficients
        shape = len(c), 2 * self._width, c.shape[3]
        decay, turn = c.reshape(shape), np.stack([-c[:, 1], c[:, 0]], axis=1).reshape(shape)
        rate = self.poles.real[:, None, None]
        return np.stack([rate * decay, -rate * turn], axis=1)

    def scaled(self, scale: Array) -> "CommonPoles":
        """Return the same with outputs divided by a scale (p,)."""
        there = replace(self, data=self.data.scaled(scale))
        vars(there).update(
            {name: getattr(self, name) for name in ("_rest", "_responses", "_rows", "_products", "_root")}
        )
        return there

    def moved(self, step: Array) -> "CommonPoles":
        """Return the same at other poles: steps of logarithms of rates and of frequencies in rates, (k, 2)."""
        rate = -self.poles.real
        frequency = np.abs(self.poles.imag + rate * step[:, 1])
        decay = np.maximum(rate * np.exp(step[:, 0]), _LEAST_DECAY * frequency)
        there = replace(self, poles=-decay + 1j * frequency)
        vars(there).update(_rest=self._rest)
        return there

    @cached_property
    def normal_equations(self) -> tuple[Array, Array]:
        """Curvature (2 k, 2 k) and downward slope (2 k,) of half the sum of squares over the steps."""
        derived = self._derived
        explained = self._root.T @ (self._rows @ derived.T)
        products = derived @ derived.T - explained.T @ explained
        return curvature(self.factors, products), pull(self.factors, derived @ self.residuals)


def curvature(factors: Array, products: Array) -> Array:
    """Return the second derivatives by the poles, (2 k, 2 k), of products of derivatives (k w, k w)."""
    k, _, w, p = factors.shape
    first = factors.transpose(0, 1, 3, 2).reshape(k, 2 * p, w) @ products.reshape(k, w, k * w)
    first = first.reshape(k, 2, p, k, w).transpose(3, 0, 1, 4, 2).reshape(k, 2 * k, w * p)
    result = first @ factors.transpose(0, 2, 3, 1).reshape(k, w * p, 2)
    return result.transpose(1, 0, 2).reshape(2 * k, 2 * k)


def pull(factors: Array, products: Array) -> Array:
    """Return the first derivatives by the poles, (2 k,), of products of derivatives with residuals (k w, p)."""
    k, _, w, p = factors.shape
    return (factors * products.reshape(k, 1, w, p)).sum(axis=(2, 3)).ravel()


def root_of_inverse(products: Array) -> Array:
    """Return what makes columns with these products (c, c) orthonormal, (c, r), by Cholesky's factor.

    Columns that others make up, to the root of rounding, are left out.
    """
    size = np.sqrt(np.diagonal(products))
    size = np.where(size > 0.0, size, 1.0)
    upper, pivots, rank, _ = linalg.lapack.dpstrf(products / size / size[:, None])
    chosen = pivots[:rank] - 1
    root = np.zeros((len(size), rank))
    root[chosen] = np.triu(linalg.lapack.dtrtri(upper[:rank, :rank])[0]) / size[chosen, None]
    return root


def least_squares(rows: Array, root: Array, y: Array) -> tuple[Array, Array]:
    """Return coefficients and residuals of columns, given as rows (c, n), with the root of the inverse of their products.

    The second round takes back what rounding of products costs the first.
    """
    left, result = y, np.zeros((len(rows), y.shape[1]))
    rounding = _CLEAN * np.square(left).sum()
    for _ in range(2):
        step = root @ (root.T @ (rows @ left))
        left, result = left - rows.T @ step, result + step
        if np.square(left).sum() > rounding:
            break
    return result, left


def fitted(start: CommonPoles, least: float = _DONE) -> CommonPoles:
    """Return the least squares over the poles too, or what steps towards it give while they gain more than the least.

    Gains are of the sum of squares, in squared errors of one number.  A damped step that is expected to gain less is not
    taken.
    """
    here, damping = start, _DAMPING
    if not len(here.poles):
        return here
    for _ in range(_STEPS):
        second, downward = here.normal_equations
        size = np.sqrt(np.maximum(np.diagonal(second), 0.0))
        if not size.any():  # wherever the poles are, what they do is explained
            return here
        size = np.maximum(size, np.finfo(float).eps * size.max())
        second, downward = second / size / size[:, None], downward / size
        while True:
            damped = second + damping * np.eye(len(size))
            step = np.linalg.solve(damped, downward)
            if downward @ step * here.residuals.size < least * here.cost:
                return here
            step = step / size
            step *= min(1.0, _FARTHEST / max(np.abs(step).max(), np.finfo(float).tiny))
            there = here.moved(step.reshape(-1, 2))
            if there.cost < here.cost or damping > _GIVE_UP:
                break
            damping *= 10.0
        if there.cost >= here.cost:
            return here
        fall = (1.0 - there.cost / here.cost) * here.residuals.size
        here, damping = there, max(damping / 10.0, _LEAST_DAMPING)
        if fall < least:
            break
    return here
