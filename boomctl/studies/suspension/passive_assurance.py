"""What vouches for a suspension of springs and dampers alone: a proof over other booms, the exact boom."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from boomctl.analysis.sigma import SigmaResult
from boomctl.boom.parameters import BoomParameters
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.studies.suspension.assurance import HalfAssurance, WorstDeposit, assured_half, corner_sigma, exact_sigma
from boomctl.studies.suspension.scene import FieldScene, suspension_model


@dataclass(frozen=True)
class PassiveAssurance:
    """What was found about a suspension without a controller.

    Attributes
    ----------
    jolt, yaw : HalfAssurance
        What was found of either half, margins apart: there is no loop that could have one.
    exact_sigma : SigmaResult
        Singular values with the exact beam.
    family_sigma : tuple of SigmaResult
        Singular values at corners and middles of the edges of the uncertainty.
    deposit : WorstDeposit
        The least even deposit found over the box.
    """

    jolt: HalfAssurance
    yaw: HalfAssurance
    exact_sigma: SigmaResult = field(repr=False)
    family_sigma: tuple[SigmaResult, ...] = field(repr=False)
    deposit: WorstDeposit

    __repr__ = compact

    @property
    def robust(self) -> bool:
        """Whether it is proved stable over the whole uncertainty."""
        return self.jolt.box.proved and self.yaw.box.proved

    @property
    def statements(self) -> Mapping[str, str]:
        """All of it in words."""
        said = {f"jolt: {what}": text for what, text in self.jolt.statements.items()}
        said |= {f"yaw: {what}": text for what, text in self.yaw.statements.items()}
        said["worst deposit found there"] = self.deposit.statement
        said["exact boom"] = f"largest singular value there {self.exact_sigma.peak:.4g}"
        return said


def no_controller(half: str) -> control.StateSpace:
    """Return the controller of the jolt or the yaw that does nothing."""
    side = {"jolt": "sym", "yaw": "anti"}[half]
    return control.ss([], [], [], [[0.0]], inputs=[f"stroke_{side}"], outputs=[f"suspension_{side}"])


def assure_passive(p: BoomParameters, scene: FieldScene) -> PassiveAssurance:
    """Examine a boom whose suspension has springs and dampers alone."""

    model = suspension_model(p, scene.elements, scene.accelerometer_hz)
    return PassiveAssurance(
        jolt=assured_half("jolt", p, no_controller("jolt"), None),
        yaw=assured_half("yaw", p, no_controller("yaw"), None),
        exact_sigma=exact_sigma(p, None, model, scene.accelerometer_hz),
        family_sigma=corner_sigma(p, None, scene),
        deposit=WorstDeposit.over(p, None, scene, 0.0),
    )
