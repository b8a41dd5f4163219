"""What vouches for a suspension that is sampled: margins at the samples, a proof over the uncertainty, a finer mesh.

What is looked at on the exact beam in continuous time (:mod:`boomctl.studies.suspension.assurance`) is looked at here on a
mesh of many elements.  The field run, and ``boomctl.analysis.sampled_norm``, have what happens between samples.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from boomctl.analysis.margins import SamplingCostsMarginWarning, margins
from boomctl.analysis.sigma import SigmaResult
from boomctl.boom.model import TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.structure.model import split_symmetric
from boomctl.studies.suspension.assurance import (
    HalfAssurance,
    WorstDeposit,
    assured_half,
    corner_sigma,
    split_halves,
)
from boomctl.studies.suspension.performance import loop_between
from boomctl.studies.suspension.scene import FieldScene, suspension_model

_FINE = 60  # elements of the finer mesh: frequencies below half the sampling rate as those of the exact beam to 1e-5


@dataclass(frozen=True)
class SampledAssurance:
    """What was found about a sampled loop, apart from its synthesis.

    Attributes
    ----------
    jolt, yaw : HalfAssurance
        What was found of either half, at the samples.
    finer : float
        Size of the largest pole ``z`` of the loop on a finer mesh; below one it is stable.
    deposit : WorstDeposit
        The least even deposit found over the box.
    family_sigma : tuple of SigmaResult
        Singular values at corners and middles of the edges of the box.
    """

    jolt: HalfAssurance
    yaw: HalfAssurance
    finer: float
    deposit: WorstDeposit
    family_sigma: tuple[SigmaResult, ...] = field(repr=False)

    __repr__ = compact

    @property
    def robust(self) -> bool:
        """Whether the loop is proved stable over the whole uncertainty and stable on the finer mesh."""
        return self.jolt.box.proved and self.yaw.box.proved and self.finer < 1.0

    @property
    def statements(self) -> Mapping[str, str]:
        """All of it in words."""
        said: dict[str, str] = {}
        for name, half in (("jolt", self.jolt), ("yaw", self.yaw)):
            said |= {f"{name}: {what}": text for what, text in half.statements.items()}
        said["worst deposit found there"] = self.deposit.statement
        finer = "stable" if self.finer < 1.0 else "NOT stable"
        said[f"mesh of {_FINE} elements"] = f"{finer}: largest pole {self.finer:.5f}"
        return said


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
        for name, half, part in zip(("jolt", "yaw"), split_symmetric(model), parts, strict=True):
            found.append(assured_half(name, p, part, band, margins(half, part, delay=delay), delay))
    fine = loop_between(suspension_model(p, _FINE, band), K, TIPS, delay=delay)
    return SampledAssurance(
        jolt=found[0],
        yaw=found[1],
        finer=float(np.abs(fine.poles()).max()),
        deposit=WorstDeposit.over(p, K, scene, delay),
        family_sigma=corner_sigma(p, K, scene, delay),
    )
