"""FOAM, the first-order approximate model: kinetic energy to second order in the beam's coordinates."""

import numpy as np

from boomctl.rotating_beam.modal.equations import Tip, block_diagonal
from boomctl.rotating_beam.modal.first_order import FirstOrderEquations
from boomctl.rotating_beam.modal.integrals import ModalIntegrals


def foam(integrals: ModalIntegrals) -> FirstOrderEquations:
    """FOAM, Eqs. (24)-(34) without (35)-(39) of Bai et al. (2009): axial and transverse coordinates, stiffening."""
    m = integrals
    zero = np.zeros_like(m.M1)
    return FirstOrderEquations(
        rigid_inertia=m.inertia,
        M=block_diagonal(m.M1, m.M2),
        N=block_diagonal(m.M1, m.M2 - m.D),
        B=np.block([[zero, m.R], [-m.R.T, zero]]),
        C=block_diagonal(m.C1, m.C2),
        K=block_diagonal(m.K1, m.K2),
        V=np.concatenate([m.V1, np.zeros_like(m.V2)]),
        W=np.concatenate([np.zeros_like(m.V1), m.V2]),
        keeps_inertia_torque=True,
        has_axial=True,
        tip=Tip(
            transverse=np.concatenate([np.zeros_like(m.tip1), m.tip2]),
            axial=np.concatenate([m.tip1, np.zeros_like(m.tip2)]),
            shortening=block_diagonal(zero, m.S_tip),
        ),
    )
