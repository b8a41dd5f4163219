"""Result of a fit: parameters, confidence intervals, unidentifiable combinations."""

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from math import inf
from textwrap import fill, shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from boomctl.arrays import Array
from boomctl.identification.families import of_fit, union
from boomctl.identification.fit_certificate import FitCertificate
from boomctl.identification.identifiability import ParameterCombination
from boomctl.identification.measured import Measured
from boomctl.printing import WIDTH, DataFrame, Summarized, count, data_frame
from boomctl.structure.families import Family

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class FitResult(Summarized):
    """Result of a parameter fit.

    Attributes
    ----------
    parameters : dataclass or dict
        Parameters, of the type of the initial ones, with the fitted values.
    names : tuple of str
        The free parameters.
    values : dict of str to float
        Fitted values of the free parameters.
    intervals : dict of str to (float, float)
        Confidence interval of each free parameter: from the covariance of the linearized model and Student's t,
        symmetric in the logarithm of positive parameters.  An end is infinite (0 for a positive parameter) if the
        measurements do not bound the parameter within its range.
    confidence_level : float
        Confidence of the intervals, between 0.5 and 1.
    standard_errors : dict of str to float
        Standard error of each parameter, from ``uncertainty_source``; ``inf`` if a parameter is not identifiable.
    covariance : (p, p) ndarray
        Covariance of the free parameters, from ``uncertainty_source``, in the parameters' units; ``inf`` and ``nan`` in rows
        and columns of parameters that are not identifiable.
    data : Measured
        Measured data, in the form in which they are compared with the model.
    best_fit, initial_fit : ndarray
        Values of the model that correspond to the measured values, at the fit and at the start.
    mode_numbers : tuple of int or None
        Mode number of each measured eigenfrequency, from 1.
    residuals : ndarray
        Measured less fitted values, in the shape of ``best_fit``: for relative errors the difference of logarithms.
    error_std : float
        Standard deviation of the errors (relative or absolute, of weight 1; for complex values, of each part), as specified
        or estimated from the residuals; ``nan`` if there are too few residuals.
    error_std_estimated : bool
        True if ``error_std`` was estimated.
    dof : int
        Number of measured values less the number of identifiable combinations of parameters.
    unidentifiable : tuple of ParameterCombination
        Combinations of parameters that are not or weakly identifiable.
    certificate : FitCertificate
        Verification of the fit, independent of the solver.
    uncertainty_source : str
        Origin of the intervals: data sets, residuals correlated over frequency, or errors treated as independent.
    parameter_dof : dict of str to float
        Degrees of freedom of each standard error, for Student's t; infinite if ``error_std`` was specified.
    per_dataset : tuple of dict
        Values for each of several data sets separately; empty for one data set.
    nfev : int
        Evaluations of the model by the searches from all starts, those for derivatives not counted.
    elapsed : float
        Run time [s].
    model : callable or family, or None
        Function or family that was fitted; None after unpickling if it cannot be pickled.
    """

    parameters: Any
    names: tuple[str, ...]
    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    confidence_level: float
    standard_errors: dict[str, float]
    covariance: Array
    data: Measured
    best_fit: Array
    initial_fit: Array
    mode_numbers: tuple[int, ...] | None
    residuals: Array
    error_std: float
    error_std_estimated: bool
    dof: int
    unidentifiable: tuple[ParameterCombination, ...]
    certificate: FitCertificate
    uncertainty_source: str
    parameter_dof: dict[str, float]
    per_dataset: tuple[dict[str, float], ...]
    nfev: int
    elapsed: float = field(repr=False, compare=False)
    model: Any = field(default=None, repr=False, compare=False)

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        try:
            pickle.dumps(self.model)
        except (pickle.PicklingError, AttributeError, TypeError):  # a function within a function
            state["model"] = None
        return state

    @property
    def success(self) -> bool:
        """True if the minimum is certified; see ``certificate``, whose ``adequacy`` compares residuals with errors."""
        return self.certificate.certified

    def family(
        self,
        probability: float = 0.95,
        range_margin: float = 0.0,
        *,
        union_with: "Sequence[FitResult]" = (),
        model: Any = None,
    ) -> Family:
        """Return the structures over a box that holds all parameters at once with a probability.

        Parameters
        ----------
        probability : float
            Probability that the box contains all parameters, between 0.5 and 1: ranges are wider than intervals, by
            Bonferroni's bound.
        range_margin : float
            Fraction of each value by which its range is widened to either side, for changes after the measurement.
        union_with : sequence of FitResult
            Fits of the same parameters to other measurements: the box is the smallest that contains the boxes of all.
        model : callable, optional
            Function from parameters to the `SecondOrderModel` or hub-beam to be controlled, for example with actuators or
            their delay.  By default the model of the fit.

        Returns
        -------
        PolynomialFamily
            For `tune`, `worst_case`, `robust_stability`, `robust_stability_margin`; ``ranges`` are the box.

        Raises
        ------
        TypeError, ValueError
            If the measurements do not bound a parameter, or its interval has zero width; or if the model is not a
            `SecondOrderModel` or hub-beam, or not polynomial in the parameters.

        Examples
        --------
        >>> import boomctl as bc
        >>> def mass(p):
        ...     return bc.structure.SecondOrderModel([[2.0]], [[0.1]], [[p["stiffness"]]], {"force": [1.0]}, {"place": [1.0]})
        >>> found = bc.fit(mass, [0.8], initial={"stiffness": 10.0}, free=["stiffness"], error_std=0.01)
        >>> [round(end, 1) for end in found.family(range_margin=0.1).ranges["stiffness"]]
        [44.2, 57.8]
        """
        ranges = union(self, union_with, probability, range_margin)
        return of_fit(self.model if model is None else model, self.parameters, ranges)

    @property
    def _uncertain(self) -> tuple[dict[str, tuple[float, float, float]], dict[str, float]]:
        """Value, interval and dof of each parameter."""
        return {name: (self.values[name], *self.intervals[name]) for name in self.names}, self.parameter_dof

    def interval_text(self, name: str) -> str:
        """Return the interval of a parameter in words.

        Parameters
        ----------
        name : str
            One of ``names``.

        Returns
        -------
        str
            Its ends, such as "1060 to 1271", or on which side it is open; "not determined" where it is on both,
            "no interval" if ``dof`` is 0.
        """
        low, high = self.intervals[name]
        open_low = low == -inf or (low == 0.0 and self.values[name] > 0.0)
        if high == inf:
            unbounded = "not determined" if self.parameter_dof[name] else "no interval"
            return unbounded if open_low else f"{low:.6g} or more"
        return f"{high:.6g} or less" if open_low else f"{low:.6g} to {high:.6g}"

    def to_pandas(self) -> DataFrame:
        """Return the parameters as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            One row for each parameter: value, standard error, interval, dof.
        """
        low, high = ({name: self.intervals[name][end] for name in self.names} for end in (0, 1))
        columns = {
            "value": self.values,
            "standard_error": self.standard_errors,
            "lower_bound": low,
            "upper_bound": high,
        }
        return data_frame(columns | {"dof": self.parameter_dof}, "parameter", index=self.names)

    def __str__(self) -> str:
        """Return parameters, intervals, unidentifiable combinations and the certificate as text.

        Returns
        -------
        str
            One line for each parameter, then the results of the fit.
        """
        width = max(len(name) for name in self.names)
        numbers = f"{self.data.size:,} {'value' if self.data.size == 1 else 'values'} ({self.data.kind})"
        lines = [f"fit of {count(len(self.names), 'parameter')} to {numbers}", self.certificate.adequacy]
        lines += [f"{n:{width}}  {self.values[n]:<12.6g} {self.interval_text(n)}" for n in self.names]
        lines += [item.description for item in self.unidentifiable]
        for k, values in enumerate(self.per_dataset, start=1):
            lines.append(f"data set {k}: {', '.join(f'{n} = {value:.5g}' for n, value in values.items())}")
        return "\n  ".join([*lines, self._errors(), self.certificate.checks])

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {self.values[name]:.6g} ({self.interval_text(name)})" for name in self.names)
        lines = [values, *(item.description for item in self.unidentifiable[:1]), self.certificate.checks]
        head = fill(f"FitResult: {self.certificate.adequacy}", WIDTH, subsequent_indent="  ")
        return "\n  ".join([head, *(shorten(line, WIDTH - 2, placeholder=" ...") for line in lines)])

    def _errors(self) -> str:
        if np.isnan(self.error_std):
            return "no residual degrees of freedom: set error_std"
        size = f"{100.0 * self.error_std:.3g} %" if self.data.errors == "relative" else f"{self.error_std:.3g}"
        origin = "estimated from residuals" if self.error_std_estimated else "specified"
        intervals = f"{100.0 * self.confidence_level:g} % intervals from {self.uncertainty_source}"
        return f"error standard deviation at weight 1: {size}, {origin}\n  {intervals}"

    def plot(self, ax: "Axes | None" = None, **style: Any) -> "Axes":
        """Draw measured values, fitted values and those at the start.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; by default a new figure, which pyplot knows.
        **style
            Of what is fitted, as matplotlib's ``plot`` takes it.

        Returns
        -------
        matplotlib.axes.Axes
            Those drawn on.
        """
        return import_module("boomctl.plotting.identification").plot_fit(self, ax=ax, **style)
