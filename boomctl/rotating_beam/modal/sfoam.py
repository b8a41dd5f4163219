"""SFOAM, the simplified first-order approximate model: FOAM without axial coordinates."""

import numpy as np

from boomctl.rotating_beam.modal.equations import Tip
from boomctl.rotating_beam.modal.first_order import FirstOrderEquations
from boomctl.rotating_beam.modal.integrals import ModalIntegrals


def sfoam(integrals: ModalIntegrals, *, consistent: bool = False) -> FirstOrderEquations:
    """SFOAM, Eq. (40) of Bai et al. (2009), or its energy-consistent variant.

    Parameters
    ----------
    integrals : ModalIntegrals
    consistent : bool
        Keep ``Q_theta`` of Eq. (32), which Eq. (40) leaves out: energy and angular momentum are then conserved.
    """
    m = integrals
    zero = np.zeros_like(m.M2)
    return FirstOrderEquations(
        rigid_inertia=m.inertia,
        M=m.M2,
        N=m.M2 - m.D,
        B=zero,
        C=m.C2,
        K=m.K2,
        V=np.zeros_like(m.V2),
        W=m.V2,
        keeps_inertia_torque=consistent,
        has_axial=False,
        tip=Tip(transverse=m.tip2, axial=np.zeros_like(m.tip2), shortening=m.S_tip),
    )
