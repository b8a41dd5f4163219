"""Singular values of many machines, to be swept: models that differ in numbers alone are computed together."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from boomctl.analysis.model_norm import SplitModel, singular_values_together
from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.checks import frequencies, function_of, instance, known, sequence, truth
from boomctl.printing import compact
from boomctl.structure.model import SecondOrderModel

_TOGETHER = (
    50  # models computed in one call: half the time of one by one, and their arrays stay in the cache (measured)
)
_ASKED = 200  # machines asked for at a time, some of which have the same shape: a fraction of a second (a choice)
_MACHINE = tuple(each.name for each in fields(BoomParameters))
_MODEL = ("discretization", "elements", "excitation", "order", "accuracy", "band_hz")
_SHAPE = (
    "length",
    "actuator_distance",
    "spring_distance",
    *_MODEL,
)  # what more than the weights of a boom follows from


@dataclass(frozen=True, eq=False)
class SigmaStudy:
    """Singular values of machines over frequency, as a function of their parameters; for :func:`boomctl.sweep`.

    It returns ``omega``, and ``sigma`` in rows, descending.  A sweep computes many machines in one call.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    build : callable or None
        Returns a `SecondOrderModel` of the swept parameters.  None: the spray boom; swept are then fields of
        `BoomParameters`, and ``elements``, ``discretization``, ``order``, ``excitation``, ``accuracy`` and ``band_hz`` of
        :func:`boomctl.spray_boom`.
    inputs, outputs : tuple of str or None
        Between which signals; by default as for :func:`boomctl.sigma`.
    certified_peak : bool
        Whether ``peak``, the certified H-infinity norm, and its frequency ``peak_omega`` [rad/s] are found as well.

    Raises
    ------
    TypeError, ValueError
        Frequencies negative or not finite; no function.

    Examples
    --------
    >>> import boomctl as bc
    >>> study = bc.studies.SigmaStudy([1.0, 2.0, 4.0])
    >>> found = bc.sweep(study, over={"spring_stiffness": [550.0, 1100.0]})
    >>> found["sigma"].shape  # springs, singular values, frequencies
    (2, 2, 3)
    >>> found["sigma"][:, 0].round(2)
    array([[34.06,  3.19,  7.98],
           [11.78, 10.22, 13.4 ]])
    """

    omega: Array
    build: Callable[..., SecondOrderModel] | None = None
    inputs: tuple[str, ...] | None = None
    outputs: tuple[str, ...] | None = None
    certified_peak: bool = False

    chunk: ClassVar[int] = _ASKED
    units: ClassVar[Mapping[str, str]] = {"omega": "rad/s", "peak_omega": "rad/s"}
    dims: ClassVar[Mapping[str, tuple[str, ...]]] = {"omega": ("omega",), "sigma": ("singular_value", "omega")}

    __repr__ = compact

    def __post_init__(self) -> None:
        object.__setattr__(self, "omega", frequencies("omega", self.omega))
        if self.build is not None:
            function_of("build", self.build, "the swept parameters")
        for name in ("inputs", "outputs"):
            given = getattr(self, name)
            if given is not None:
                listed = (given,) if isinstance(given, str) else sequence(name, given, "names")
                object.__setattr__(self, name, tuple(instance(f"a name in {name}", each, str) for each in listed))
        truth("certified_peak", self.certified_peak)

    def __call__(self, **point: Any) -> dict[str, Any]:
        """Return the singular values of one machine."""
        return self.many([point])[0]

    def many(self, points: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return the singular values of several machines.

        Parameters
        ----------
        points : sequence of mapping
            Parameters of each machine by name.

        Returns
        -------
        list of dict
            ``omega`` and ``sigma`` of each, and its peak if that is asked for.

        Raises
        ------
        TypeError, ValueError
            Unknown parameters, or out of range; unknown signals; an infinite response.
        """
        models: list[SecondOrderModel] = [None] * len(points)  # type: ignore[list-item]
        shapes = [repr([point.get(name) for name in _SHAPE]) for point in points]
        for k in sorted(range(len(points)), key=shapes.__getitem__):  # booms of one shape share what they can
            models[k] = self._model(points[k])
        curves: list[Array] = []
        for k in range(0, len(models), _TOGETHER):
            split = [SplitModel.of(model) for model in models[k : k + _TOGETHER]]
            curves += singular_values_together(split, self.omega)
        for values in curves:
            if not np.isfinite(values).all():
                raise ValueError("the response is beyond all floating-point numbers at one of the frequencies")
        peaks = self._peaks(models) if self.certified_peak else ({} for _ in models)
        return [{"omega": self.omega, "sigma": values, **peak} for values, peak in zip(curves, peaks, strict=True)]

    def _model(self, point: Mapping[str, Any]) -> SecondOrderModel:
        model = (_boom if self.build is None else self.build)(**point)
        if not isinstance(model, SecondOrderModel):
            raise TypeError(f"build: expected a function that returns a SecondOrderModel, got {type(model).__name__}")
        return model.between(self.inputs, self.outputs)

    def _peaks(self, models: Sequence[SecondOrderModel]) -> Iterator[dict[str, float]]:
        for model in models:
            found = sigma(model, self.omega)
            yield {"peak": found.peak, "peak_omega": found.peak_omega}


def _boom(**changes: Any) -> SecondOrderModel:
    """Return the spray boom of Table 2 with changes of its parameters and its model."""
    for name in changes:
        known("parameter of the boom", name, (*_MACHINE, *_MODEL))
    parameters = replace(BoomParameters(), **{name: changes[name] for name in changes if name in _MACHINE})
    return spray_boom(parameters, **{name: changes[name] for name in changes if name in _MODEL})
