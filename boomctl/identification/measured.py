"""Data of a fit: natural frequencies, complex frequency responses, singular values; and those of the model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.checks import (
    finite_array,
    frequencies,
    known,
    plain_array,
    positive,
    sequence,
    some_names,
    whole,
)
from boomctl.identification.files.frequency_response import MeasuredFrequencyResponse
from boomctl.lti.frequency import singular_values
from boomctl.lti.rounding import ALIKE
from boomctl.lti.system import is_frequency_response, is_statespace, of
from boomctl.printing import compact
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.response.poles import damped_poles
from boomctl.units import warn_of_units

ERRORS = ("relative", "absolute")
RESPONSE = "complex frequency response"
BOUNDED = "bounded relative"  # for the search alone
_FURTHER_MODES = 3  # Modes of the model in addition to the measured ones, for the pairing.
_LEFT_OUT = 1e3  # relative spread with which values that are left out are paired with modes
_MIN_WEIGHT = 1e-50  # Squares of residuals divided by it do not overflow.
_MIN_RELATIVE_STD = 1e-3  # Floor on standard deviations, relative to their median.
_MAX_RELATIVE_STD = 0.2  # Of a value with relative errors: of less sure ones the logarithm is not normal, and biased.
_GROWING, _SURE = 0.6, 3.0  # rank correlation of residuals with fitted values, of relative errors: least, deviations
_AROUND = 9  # Neighboring frequencies, whose median says whether a value is sure: single estimated deviations scatter.


@dataclass(frozen=True)
class Measured:
    """Measured values with the size of their errors.

    Attributes
    ----------
    kind : str
        ``"eigenfrequencies"``, ``"complex frequency response"`` or ``"singular values"``.
    values : ndarray
        Eigenfrequencies [Hz], (m,); complex response, (p, m, n); singular values, descending, (k, n).
    spread : ndarray
        Relative magnitudes of the errors, in the shape of ``values``; infinite for omitted values.
    errors : "relative" or "absolute"
        Errors of the logarithm, or of the value itself.
    omega : (n,) ndarray or None
        Angular frequencies [rad/s]; several data sets are concatenated.
    modes : tuple of int or None
        Mode number of each eigenfrequency, from 1; None: the nearest mode.
    inputs, outputs : str, sequence of str or None
        Signals that the user named.
    labels : (tuple of str, tuple of str) or None
        Inputs and outputs of the measured data.
    member : (n,) ndarray of int, or None
        Index of the data set of each entry of the last axis of ``values``; None for one data set.
    noise : ndarray or None
        Deviation of each value relative to its ``spread``, if the measurement includes it.
    """

    kind: str
    values: Array
    spread: Array
    errors: str = "relative"
    omega: Array | None = None
    modes: tuple[int, ...] | None = None
    inputs: str | Sequence[str] | None = None
    outputs: str | Sequence[str] | None = None
    labels: tuple[tuple[str, ...], tuple[str, ...]] | None = None
    member: Array | None = None
    noise: Array | None = None

    __repr__ = compact

    @classmethod
    def of(
        cls,
        measured: object,
        modes: object,
        weights: object,
        errors: object,
        inputs: object,
        outputs: object,
    ) -> "Measured":
        """Return what was measured, checked; of a list of data sets, all of them side by side."""
        known("kind of errors", errors, ERRORS)
        if isinstance(measured, (list, tuple)) and measured and not any(np.isscalar(item) for item in measured):
            return _side_by_side([cls.of(item, modes, weights, errors, inputs, outputs) for item in measured])
        labels = omega = None
        if isinstance(measured, MeasuredFrequencyResponse) and measured.response is not None:
            measured = measured.response  # with its phase, which singular values lose
        if isinstance(measured, MeasuredFrequencyResponse):
            omega = frequencies("frequencies of measured", 2.0 * np.pi * measured.frequency_hz)
            kind, values = "singular values", -np.sort(-finite_array("data", measured.magnitude, ndim=2), axis=0)
        elif is_frequency_response(measured):
            kind, values = RESPONSE, np.asarray(measured.frdata, dtype=complex)
            omega = frequencies("frequencies of measured", np.asarray(measured.omega))
            labels = tuple(measured.input_labels), tuple(measured.output_labels)
            if not np.isfinite(values).all():
                raise ValueError("data: expected finite frequency response data")
        else:
            kind = "eigenfrequencies"
            values, modes = _eigenfrequencies(measured, modes)
        if kind != "eigenfrequencies" and modes is not None:
            raise ValueError("modes: expected None, as what was measured are no eigenfrequencies")
        if kind == "eigenfrequencies" and (inputs is not None or outputs is not None):
            raise ValueError("inputs, outputs: expected None, as eigenfrequencies have no signals")
        unit = np.abs(values) if errors == "relative" else np.ones(values.shape)
        deviation = getattr(measured, "deviation", None) if kind == RESPONSE else None
        with np.errstate(divide="ignore", invalid="ignore"):
            noise = None if deviation is None else np.asarray(deviation, float) / unit
        if weights is None and noise is not None:
            weights = _weights(_coherent(noise) if errors == "relative" else noise)
        spread = _spread(weights, values)
        if errors == "relative" and (values[np.isfinite(spread)] == 0.0).any():
            raise ValueError(
                "`data` has zeros, which have no relative error. Set their weight to 0, or errors='absolute'."
            )
        noise = None if noise is None else np.nan_to_num(noise) / spread
        return cls(kind, values, spread, str(errors), omega, modes, inputs, outputs, labels, noise=noise)  # type: ignore[arg-type]

    @property
    def sets(self) -> int:
        """Number of data sets."""
        return 1 if self.member is None else int(self.member[-1]) + 1

    @property
    def least(self) -> int:
        """Number of eigenfrequencies that a model has at least."""
        if self.modes:
            return max(self.modes)
        return len(self.values) if self.member is None else int(np.bincount(self.member).max())

    def one(self, k: int) -> "Measured":
        """Return one of the data sets; frequencies of the others remain, as a model may return values at all of them."""
        own = self.member == k
        if self.omega is not None:
            return replace(self, spread=np.where(own, self.spread, np.inf), member=None)
        modes = None if self.modes is None else tuple(np.array(self.modes)[own].tolist())
        return replace(self, values=self.values[own], spread=self.spread[own], modes=modes, member=None)

    def labeled(self, labels: Array) -> Array:
        """Return a label of each entry of the last axis for each of the residuals."""
        result = np.broadcast_to(labels, self.values.shape)[self.kept]
        return np.concatenate([result, result]) if np.iscomplexobj(self.values) else result

    @property
    def kept(self) -> Array:
        """Which values are not left out."""
        return np.isfinite(self.spread)

    @property
    def size(self) -> int:
        """Number of measured values; complex ones count twice."""
        return int(self.kept.sum()) * (2 if np.iscomplexobj(self.values) else 1)

    @property
    def scale(self) -> float:
        """Root mean square of the residuals for a relative error of one."""
        mask = self.kept
        size = np.abs(self.values[mask]) if self.errors == "absolute" else 1.0
        return float(np.sqrt(np.mean(np.square(size / self.spread[mask]))))

    def paired(self, offered: Array) -> tuple[int, ...]:
        """Return which of the modes offered each eigenfrequency is, from 1: unless it is known, the nearest ones.

        The sum of the squared residuals is the least that is possible.  A value that is left out weighs next to nothing.
        """
        from scipy.optimize import linear_sum_assignment  # long to import, and only a fit comes here

        if self.modes is not None:
            return self.modes
        if self.member is not None:
            return tuple(mode for k in range(self.sets) for mode in self.one(k).paired(offered))
        spread = np.minimum(self.spread, _LEFT_OUT * self.spread[self.kept].max())
        errors_of_pairs = _difference(offered, self.values[:, None], self.errors) / spread[:, None]
        return tuple((linear_sum_assignment(np.square(errors_of_pairs))[1] + 1).tolist())

    def difference(self, fitted: Array) -> Array:
        """Return measured less fitted; of relative errors, of the logarithms."""
        return -_difference(fitted, self.values, self.errors)

    def percent(self, fitted: Array) -> float:
        """Compute the norm of the residuals in percent of the norm of the values, both weighted."""
        values, spread = self.values[self.kept], self.spread[self.kept]
        spread = spread * np.abs(values) if self.errors == "relative" else spread
        size = float(np.linalg.norm(values / spread))
        return 100.0 * float(np.linalg.norm((fitted[self.kept] - values) / spread)) / size if size > 0.0 else np.inf

    def variance(self, differences: Array, modes: tuple[int, ...] | None) -> tuple[float, float]:
        """Compute the mean square of the errors in residuals, and its dof; ``nan`` if unknown.

        Of data sets of the same frequencies or modes, from their differences, otherwise from the deviations of the
        response.
        """
        at, sets = modes if self.omega is None else self.omega, self.sets
        if self.member is not None and len(set(np.bincount(self.member))) == 1:
            at = np.reshape(np.asarray(at), (sets, -1))
            if (at == at[0]).all():
                scaled = np.where(self.kept, differences / self.spread, 0.0)
                by_set = scaled.reshape(*scaled.shape[:-1], sets, -1)
                within = float(np.square(np.abs(by_set - by_set.mean(axis=-2, keepdims=True))).sum())
                dof = self.size * (1.0 - 1.0 / sets)
                return within / dof, dof
        return (float("nan") if self.noise is None else float(np.square(self.noise[self.kept]).mean())), np.inf

    def growing(self, differences: Array, fitted: Array) -> bool:
        """Return whether absolute errors grow with the values: by Spearman's rank correlation, the mean over entries."""
        lines, correlations = self.kept.reshape(-1, self.kept.shape[-1]), []
        scaled = (np.abs(x).reshape(lines.shape) for x in (differences / self.spread, fitted))
        for use, *pair in zip(lines, *scaled, strict=True):
            if use.sum() > 2:
                a, b = (np.argsort(np.argsort(x[use])) - 0.5 * (use.sum() - 1) for x in pair)
                correlations.append(a @ b / (a @ a))
        least = max(_GROWING, _SURE / np.sqrt(self.kept.sum()))
        return self.errors == "absolute" and bool(np.mean(correlations or [0.0]) > least)

    def residuals(self, fitted: Array) -> Array:
        """Return the included differences over their spread, as real numbers."""
        mask = self.kept
        if self.errors == BOUNDED:
            spread = self.spread[mask]
            return np.concatenate([part / spread for part in _on_the_sphere(fitted[mask] / self.values[mask])])
        scaled = (self.difference(fitted)[mask] / self.spread[mask]).ravel()
        return np.concatenate([scaled.real, scaled.imag]) if np.iscomplexobj(self.values) else scaled


def _on_the_sphere(ratio: Array) -> tuple[Array, ...]:
    """Return where ratios lie on the Riemann sphere, less where one lies: what relative errors are where they are small.

    A ratio goes through infinity where a resonance passes a measured frequency.  Its logarithm has a pole and a jump
    there, and keeps a search from passing; on the sphere it goes smoothly, and no value is further than two from another.
    """
    size = np.square(np.abs(ratio))
    height = (size - 1.0) / (size + 1.0)
    if not np.iscomplexobj(ratio):
        return (height,)
    flat = 2.0 * ratio / (size + 1.0)
    return height, flat.real - 1.0, flat.imag


def _difference(fitted: Array, measured: Array, errors: str) -> Array:
    if errors == "absolute":
        return fitted - measured
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(fitted / np.where(measured == 0.0, np.nan, measured))


def _side_by_side(sets: Sequence["Measured"]) -> "Measured":
    """Return data sets of one kind as one, joined along the last axis."""
    first, *others = sets
    kind = first.kind, first.values.shape[:-1], first.labels
    for k, other in enumerate(others, start=2):
        result = other.kind, other.values.shape[:-1], other.labels
        if result != kind or (other.modes is None) != (first.modes is None):
            raise ValueError(
                f"`data` must be data sets of one kind, shape and signals, got {kind} and set {k} with {result}."
            )
    if not others:
        return first
    joined: dict[str, Any] = {}
    for name in ("values", "spread", "omega", "modes", "noise"):
        parts = [getattr(item, name) for item in sets]
        joined[name] = None if any(part is None for part in parts) else np.concatenate(parts, axis=-1)
    joined["modes"] = None if joined["modes"] is None else tuple(joined["modes"].tolist())
    member = np.repeat(np.arange(len(sets)), [item.values.shape[-1] for item in sets])
    return replace(first, **joined, member=member)


def _coherent(noise: Array) -> Array:
    """Return relative deviations, infinite where one or the median of those around is large: the coherence is low there."""
    from scipy.ndimage import median_filter  # long to import, and only measured responses come here

    known = np.where(np.isnan(noise), np.inf, noise)
    around = median_filter(known, (1, 1, _AROUND), mode="nearest")
    result = np.where(np.maximum(known, around) > _MAX_RELATIVE_STD, np.inf, known)
    if np.isinf(result).all():
        raise ValueError(
            f"`data` has standard deviations above {100.0 * _MAX_RELATIVE_STD:g} % of the values at all frequencies."
            " Set error_model='absolute', or use a longer record."
        )
    return result


def _weights(deviation: Array) -> Array | None:
    """Return weights from standard deviations, one for the median; None if there are none."""
    known = np.isfinite(deviation)
    median = float(np.median(deviation[known])) if known.any() else 0.0
    return np.where(known, median / np.maximum(deviation, _MIN_RELATIVE_STD * median), 0.0) if median else None


def _eigenfrequencies(measured: object, modes: object) -> tuple[Array, tuple[int, ...] | None]:
    """Return measured eigenfrequencies and, where they are said, which modes they are."""
    kinds = "eigenfrequencies [Hz], FrequencyResponseData or a MeasuredFrequencyResponse"
    values = finite_array("data", _numbers("data", measured, kinds, "iuf"), ndim=1)
    if not len(values):
        raise ValueError("data: expected at least one eigenfrequency, got none")
    for value in values:
        positive("measured eigenfrequency", float(value))
    if modes is None:
        if not (np.diff(values) >= 0).all():
            raise ValueError(f"`data` must be in ascending order, got {values.tolist()}. Sort it, or give `modes`.")
        return values, None
    numbers = tuple(whole("mode", mode) for mode in sequence("modes", modes, "whole numbers"))
    if len(numbers) != len(values) or len(set(numbers)) != len(numbers):
        raise ValueError(f"`modes` must be {len(values)} different numbers, one a frequency, got {list(numbers)}.")
    return values, numbers


def _spread(weights: object, values: Array) -> Array:
    """Return the inverse of the weights, in the shape of the values."""
    if weights is None:
        return np.ones(values.shape)
    checked = finite_array("weights", weights)  # type: ignore[arg-type]
    try:
        full = np.broadcast_to(checked, values.shape)
    except ValueError:
        raise ValueError(f"`weights` must have the measured shape {values.shape}, got {checked.shape}.") from None
    if (checked < 0.0).any() or not (checked > 0.0).any() or (checked[checked > 0.0] < _MIN_WEIGHT).any():
        raise ValueError(
            f"`weights` must be zeros and numbers above {_MIN_WEIGHT:g}, got {checked.min():g} to {checked.max():g}."
        )
    with np.errstate(divide="ignore"):
        return 1.0 / full


def answered(model: Any, data: Measured) -> tuple[Array, tuple[int, ...] | None]:
    """Return a model's values in the places of those measured, and of eigenfrequencies which modes they are."""
    if data.omega is None:
        offered = _frequencies(model, data)
        modes = data.paired(offered)
        return offered[np.array(modes) - 1], modes
    omega, at = np.unique(data.omega, return_inverse=True)
    return _curves(model, data, omega)[..., at], None


def _frequencies(model: Any, data: Measured) -> Array:
    """Return the eigenfrequencies that a model offers [Hz]: some more than were measured, unless their modes are known."""
    least = data.least
    wanted = least if data.modes else least + _FURTHER_MODES
    if isinstance(model, SecondOrderModel):
        offered = damped_poles(model.structure, wanted, least=0).imag / (2.0 * np.pi)
        warn_of_units(offered)
    elif hasattr(model, "divergence_speed"):  # a hub-beam
        offered = np.asarray(model.eigenfrequencies_hz(), dtype=float)
    elif is_statespace(model):
        poles = of(model, "model").poles
        offered = np.sort(poles.imag[poles.imag > 0.0]) / (2.0 * np.pi)
    else:
        offered = np.sort(finite_array("answer of model", _numbers("model", model, "eigenfrequencies [Hz]"), ndim=1))
    if (offered <= 0.0).any():
        raise ValueError(f"model: expected eigenfrequencies above zero, got {offered.min():g}")
    if len(offered) < least:
        measured = f"modes: mode {least}" if data.modes else f"data: {least} frequencies"
        raise ValueError(f"{measured}, but the model has only {len(offered)}")
    return offered


def _curves(model: Any, data: Measured, omega: Array) -> Array:
    """Compute the response or the singular values between the measured signals, in the shape of one data set."""
    model = model.linearize() if hasattr(model, "divergence_speed") else model  # a hub-beam
    if data.kind != RESPONSE and (isinstance(model, SecondOrderModel) or is_statespace(model)):
        result = sigma(model, omega, data.inputs, data.outputs).sigma
    elif isinstance(model, SecondOrderModel):
        result = np.asarray(model.frequency_response(omega, *_signals(data, model)).frdata)
    elif is_statespace(model):
        system = of(model, "model")
        result = system.select(*_signals(data, system)).response(omega)
    elif is_frequency_response(model):
        result = _of_data(model, data, omega)
        result = result if data.kind == RESPONSE else singular_values(result)
    else:
        result = np.asarray(_numbers("model", model, f"a model or its {data.kind}"))
    wanted = (*data.values.shape[:-1], len(omega))
    if data.kind != RESPONSE and data.inputs is not None and data.outputs is not None:
        result = result[: wanted[0]]  # the largest ones
    if result.shape != wanted:
        raise ValueError(f"`model` must return {data.kind} {wanted}, got {result.shape}. Set `inputs` and `outputs`.")
    return result


def _numbers(name: str, value: Any, expected: str, kinds: str = "iufc") -> ArrayLike:
    """Return an array of numbers."""
    if value is None or isinstance(value, (str, bytes)) or plain_array(name, value).dtype.kind not in kinds:
        raise TypeError(f"{name}: expected {expected}, got {type(value).__name__}")
    return value


def _signals(data: Measured, model: Any) -> tuple[Sequence[str] | None, Sequence[str] | None]:
    """Return the signals of the model: the named ones, those of the data, or all."""
    result: list[Sequence[str] | None] = []
    primary = getattr(getattr(model, "ports", None), "primary", None) or (None, None)
    for k, (name, said) in enumerate((("input", data.inputs), ("output", data.outputs))):
        there, label = getattr(model, f"{name}_labels"), data.labels[k] if data.labels else ()
        if said is not None:
            result.append(some_names(name, said, there))
        elif label and set(label) <= set(there):
            result.append(label)
        else:
            result.append(primary[k])
    return result[0], result[1]


def _of_data(model: Any, data: Measured, omega: Array) -> Array:
    """Return the frequency response between the selected signals, at the measured frequencies."""
    grid = np.asarray(model.omega)
    if grid.shape != omega.shape or not np.allclose(grid, omega, rtol=ALIKE, atol=0.0):
        raise ValueError("model: expected a response at the measured frequencies, ascending")
    ins, outs = _signals(data, model)
    return np.asarray(model[list(outs or model.output_labels), list(ins or model.input_labels)].frdata)
