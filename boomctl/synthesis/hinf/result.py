"""What an H-infinity synthesis returns."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from boomctl.analysis.norm import NormCertificate
from boomctl.printing import sentence, system

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class HInfinityCertificate:
    """What vouches for a controller, and how far from the best possible one it is.

    Attributes
    ----------
    norm : NormCertificate
        The closed loop's H-infinity norm between two bounds.
    slowest_pole : float
        Largest real part of the closed loop's poles [rad/s], negative; ``-inf`` without states.
    lower : float
        A norm that no controller goes below: the larger of the two bounds that follow.
    frequency_bound, frequency_omega : float
        What no controller beats at one frequency [rad/s], whatever it knows.
    riccati_bound : float
        The highest level at which a condition of the two Riccati equations was seen to fail, checked by residuals and
        signs; below it no controller exists.
    riccati_reason : str
        Which condition failed there.
    level : float
        The level for which the controller was computed.
    fastest_pole, fastest_pole_limit : float
        Largest magnitude of the controller's poles and what was allowed [rad/s].
    solver : str
        Which solver's controller passed.
    statement : str
        All this in a sentence.
    """

    norm: NormCertificate
    slowest_pole: float
    lower: float
    frequency_bound: float
    frequency_omega: float
    riccati_bound: float
    riccati_reason: str
    level: float
    fastest_pole: float
    fastest_pole_limit: float
    solver: str
    statement: str

    def __repr__(self) -> str:
        return sentence("HInfinityCertificate", self.statement)

    @property
    def distance(self) -> float:
        """How far above the lower bound the closed loop's norm lies at most, relative to it."""
        if self.lower > 0.0:
            return self.norm.upper / self.lower - 1.0
        return float("inf") if self.norm.upper > 0.0 else 0.0


@dataclass(frozen=True)
class HInfinityResult:
    """A controller and the closed loop it was verified in.

    Attributes
    ----------
    controller : control.StateSpace
        From the measurements to the controls, ``u = K y``, named as in the generalised plant.
    closed_loop : control.StateSpace
        From the disturbances to the performance signals, named.
    gamma : float
        The closed loop's H-infinity norm, verified.
    certificate : HInfinityCertificate
    """

    controller: "control.StateSpace"
    closed_loop: "control.StateSpace"
    gamma: float
    certificate: HInfinityCertificate

    def __repr__(self) -> str:
        verified = (
            f"norm of the closed loop {self.gamma:.6g}, verified; no controller goes below {self.certificate.lower:.6g}"
        )
        return f"HInfinityResult: controller of {system(self.controller)}\n  {verified}"
