"""What vouches for a suspension that is sampled: margins at the samples, other booms point by point, a finer mesh.

What is proved in continuous time over a box and on the exact beam (:mod:`boomctl.studies.suspension.assurance`) is looked at
here at points of the box and on a mesh of many elements: ``boomctl.robust_stability`` proves the box of a sampled loop, but
takes minutes.  The field run, and ``boomctl.sampled_norm``, have what happens between samples.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from boomctl.analysis.margins import Margins, SamplingCostsMarginWarning, margins
from boomctl.analysis.norm import hinf_norm
from boomctl.analysis.sigma import SigmaResult, sigma
from boomctl.boom.families import scaled_boom
from boomctl.boom.model import TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.structure.model import split_symmetric
from boomctl.studies.suspension.assurance import FAMILY_ELEMENTS, MASS, SPRING, WorstDeposit, margin_text, split_halves
from boomctl.studies.suspension.performance import loop_between
from boomctl.studies.suspension.scene import FieldScene, suspension_model

_POINTS = 5  # of springs and of masses, ends included: twenty-five booms, a tenth of a second each (a choice)
_FINE = 60  # elements of the finer mesh: frequencies below half the sampling rate as those of the exact beam to 1e-5
_FREQUENCIES = np.geomspace(0.15, 130.0, 260)  # [rad/s], drawn, as far as below half the sampling rate


@dataclass(frozen=True)
class SampledAssurance:
    """What was found about a sampled loop, apart from its synthesis.

    Attributes
    ----------
    jolt, yaw : Margins
        Margins of either half at the samples.
    points : int
        Number of booms tried: springs of 70 to 130 %, beam mass of 80 to 120 %.
    slowest, finer : float
        Size of the largest pole ``z`` of the loop, of all these booms and on a finer mesh; below one it is stable.
    worst : float
        Largest certified peak from platform to tips at the samples among these booms.
    worst_at : dict
        Springs and mass of that boom, relative.
    deposit : WorstDeposit
        The least even deposit found over that box.
    family_sigma : tuple of SigmaResult
        Singular values at corners and middles of the edges of the box.
    """

    jolt: Margins
    yaw: Margins
    points: int
    slowest: float
    finer: float
    worst: float
    worst_at: Mapping[str, float]
    deposit: WorstDeposit
    family_sigma: tuple[SigmaResult, ...] = field(repr=False)

    __repr__ = compact

    @property
    def robust(self) -> bool:
        """Whether the loop is stable for every boom tried and on the finer mesh; nothing is proved in between here."""
        return self.slowest < 1.0 and self.finer < 1.0

    @property
    def statements(self) -> Mapping[str, str]:
        """All of it in words."""
        said = {f"{name}: margins at the samples": margin_text(found) for name, found in self._halves}
        stable = "stable" if self.slowest < 1.0 else "NOT stable everywhere"
        said[f"springs ±30 %, boom mass ±20 %, {self.points} booms"] = (
            f"{stable}: largest pole {self.slowest:.5f}; at these points, not proved between them (see robust_stability)"
        )
        where = ", ".join(f"{name} {value:.3g}" for name, value in self.worst_at.items())
        said["worst peak found there"] = f"{self.worst:.4g} at {where}"
        said["worst deposit found there"] = self.deposit.statement
        finer = "stable" if self.finer < 1.0 else "NOT stable"
        said[f"mesh of {_FINE} elements"] = f"{finer}: largest pole {self.finer:.5f}"
        return said

    @property
    def _halves(self) -> tuple[tuple[str, Margins], ...]:
        return (("jolt", self.jolt), ("yaw", self.yaw))


def assure_sampled(p: BoomParameters, K: control.StateSpace, scene: FieldScene, delay: float) -> SampledAssurance:
    """Examine the closed loop of a boom and a discrete controller whose forces act so much later [s].

    Raises
    ------
    ValueError
        The controller mixes the halves of the machine: it cannot be examined half by half.
    """
    band = scene.accelerometer_hz
    model = suspension_model(p, scene.elements, band)
    *parts, _ = split_halves(model, K)
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SamplingCostsMarginWarning)  # margins are reported: what they were is not asked
        for half, part in zip(split_symmetric(model), parts, strict=True):
            found.append(margins(half, part, delay=delay))
    worst, slowest, family = (0.0, {}), 0.0, []
    drawn = _FREQUENCIES[np.pi / K.dt > _FREQUENCIES]
    springs, masses = np.linspace(*SPRING, _POINTS), np.linspace(*MASS, _POINTS)
    for spring, mass in product(springs, masses):
        loop = loop_between(suspension_model(scaled_boom(p, spring, mass), FAMILY_ELEMENTS, band), K, TIPS, delay=delay)
        slowest = max(slowest, float(np.abs(loop.poles()).max()))
        peak = hinf_norm(loop).lower
        if peak > worst[0]:
            worst = peak, {"spring": float(spring), "mass": float(mass)}
        if (
            (spring, mass) != (1.0, 1.0)
            and spring in springs[[0, _POINTS // 2, -1]]
            and mass in masses[[0, _POINTS // 2, -1]]
        ):
            family.append(sigma(loop, drawn))
    fine = loop_between(suspension_model(p, _FINE, band), K, TIPS, delay=delay)
    return SampledAssurance(
        jolt=found[0],
        yaw=found[1],
        points=_POINTS**2,
        slowest=slowest,
        finer=float(np.abs(fine.poles()).max()),
        worst=worst[0],
        worst_at=worst[1],
        deposit=WorstDeposit.over(p, K, scene, delay),
        family_sigma=tuple(family),
    )
