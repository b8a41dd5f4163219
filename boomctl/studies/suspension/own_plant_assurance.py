"""What vouches for a suspension on a plant of its own, as where states are measured: a proof over other booms."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from boomctl.analysis.box.robustness import robust_stability
from boomctl.analysis.box.worst_case import worst_case
from boomctl.analysis.sigma import SigmaResult
from boomctl.boom.families import scaled_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters, boom_parameters
from boomctl.lti.python_control import control
from boomctl.printing import compact
from boomctl.structure.families import AffineFamily
from boomctl.structure.model import SecondOrderModel
from boomctl.studies.suspension.assurance import MASS, SPRING, HalfAssurance, WorstDeposit, corner_sigma
from boomctl.studies.suspension.scene import ACCELERATIONS, FieldScene, suspension_model


@dataclass(frozen=True)
class OwnPlantAssurance:
    """What was found about a closed loop on a plant of its own.

    Attributes
    ----------
    boom : HalfAssurance
        Stability and the largest peak from platform to tips over springs of 70 to 130 % and a beam mass of 80 to 120 %, of
        the whole boom.
    family_sigma : tuple of SigmaResult
        Singular values at corners and middles of the edges of the uncertainty.
    deposit : WorstDeposit
        The least even deposit found over the box.
    """

    boom: HalfAssurance
    family_sigma: tuple[SigmaResult, ...] = field(repr=False)
    deposit: WorstDeposit

    __repr__ = compact

    @property
    def robust(self) -> bool:
        """Whether it is proved stable over the whole uncertainty."""
        return self.boom.box.proved

    @property
    def statements(self) -> Mapping[str, str]:
        """All of it in words."""
        return {**self.boom.statements, "worst deposit found there": self.deposit.statement}


def suspension_family(parameters: BoomParameters | None = None, elements: int = 6) -> AffineFamily:
    """Return the boom of the suspensions, nozzles among its outputs, over the box on which they are judged.

    Parameters
    ----------
    parameters : BoomParameters, optional
    elements : int
        Finite elements.

    Returns
    -------
    AffineFamily
        Parameters ``"spring"`` from 0.7 to 1.3 and ``"mass"`` from 0.8 to 1.2; signals as of
        :func:`suspension_model`, without its accelerations.
    """
    p = boom_parameters(parameters)

    def make(values: Mapping[str, float]) -> SecondOrderModel:
        model = suspension_model(scaled_boom(p, **values), elements, nozzles=True)
        return model.select(None, [name for name in model.outputs if name not in ACCELERATIONS])

    return AffineFamily.through({"spring": SPRING, "mass": MASS}, make)


def assure_own_plant(
    p: BoomParameters, family: AffineFamily, K: control.StateSpace, scene: FieldScene
) -> OwnPlantAssurance:
    """Examine the closed loops of a family of booms and a controller in continuous time."""
    return OwnPlantAssurance(
        boom=HalfAssurance(None, robust_stability(family, K), worst_case(family, K, ACTUATORS, TIPS)),
        family_sigma=corner_sigma(p, K, scene, family=family),
        deposit=WorstDeposit.over(p, K, scene, scene.delay, family),
    )
