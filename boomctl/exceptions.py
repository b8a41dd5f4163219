"""Exceptions and warnings of the library.

Examples
--------
Catch every exception of the library, and ignore its warnings:

>>> import warnings
>>> import boomctl as bc
>>> import control
>>> unstable = control.ss([[1.0]], [[0.0]], [[1.0]], 0.0, inputs="u", outputs="y")
>>> try:
...     with warnings.catch_warnings():
...         warnings.simplefilter("ignore", bc.exceptions.BoomctlWarning)
...         bc.lqr(unstable, 1.0, 1.0)
... except bc.exceptions.BoomctlError as error:
...     print(type(error).__name__)
SynthesisError
"""


class BoomctlError(Exception):
    """Base class of the exceptions."""


class CertificateError(BoomctlError, RuntimeError):
    """Raised if `prove` refutes a result; the message contains the counterexample."""


class ReductionError(BoomctlError, RuntimeError):
    """Raised if a reduced system cannot be verified; the message contains the failed check."""


class SimulationError(BoomctlError, RuntimeError):
    """Raised if a motion cannot be computed; the message contains the reason and the time of failure."""


class SlewError(BoomctlError, RuntimeError):
    """Raised if a slew is infeasible, or cannot be computed or verified.

    The message names the active limit and its time.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> A, B, C = [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]]
    >>> rigid = control.ss(A, B, C, 0.0, inputs="torque", outputs="angle")  # of unit inertia
    >>> try:
    ...     bc.optimal_slew(rigid, angle=1.0, torque_limit=1.0, objective="effort", duration=1.0)
    ... except bc.exceptions.SlewError as error:
    ...     print(str(error).split(";")[0])
    duration = 1 s: too short for a change of angle by 1
    """


class LimitsTooTightError(SlewError):
    """Raised if no slew on a mesh satisfies the limits.

    Attributes
    ----------
    excess : float
        Smallest sum of scaled constraint violations that IPOPT finds.
    """

    def __init__(self, message: str, excess: float = float("inf")) -> None:  # pickled by its message and attributes
        super().__init__(message)
        self.excess = excess


class SynthesisError(BoomctlError, RuntimeError):
    """Raised if a controller cannot be computed or verified.

    The message names the violated assumption and the signal.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> hidden = control.ss([[1.0]], [[0.0]], [[1.0]], 0.0, inputs="u", outputs="y")
    >>> try:
    ...     bc.lqr(hidden, 1.0, 1.0)
    ... except bc.exceptions.SynthesisError as error:
    ...     print(str(error).split(":")[0])
    The plant is not stabilizable
    """


class BoomctlWarning(UserWarning):
    """Base class of the warnings."""


class AccuracyWarning(BoomctlWarning):
    """Issued if the estimated rounding error of a result exceeds its usual accuracy."""


class FeedbackSignWarning(BoomctlWarning):
    """Issued if the loop ``u = K y`` is unstable, and stable with ``-K``."""


class LowerOrderWarning(BoomctlWarning):
    """Issued if a reduced system has fewer states than the requested order."""


class MarginAccuracyWarning(BoomctlWarning):
    """Issued if rounding errors of the loop's matrices limit the accuracy of its margins."""


class MarginLossWarning(BoomctlWarning):
    """Issued if sampling and delay reduce a disk margin by more than 3 dB."""


class ReductionWarning(BoomctlWarning):
    """Issued if the reduction error of the plant has a large effect on the closed loop."""


class SingularFrequencyWarning(BoomctlWarning):
    """Issued if a frequency response is requested at a pole; it is evaluated at a nearby frequency."""


class SweepWarning(BoomctlWarning):
    """Issued if a function fails at some points of a sweep."""


class WindupWarning(BoomctlWarning):
    """Issued if a controller has no anti-windup correction for a limited control."""
