"""TLAM, the traditional linear approximate model: FOAM without the shortening that goes with bending."""

from dataclasses import replace

import numpy as np

from boomctl.rotating_beam.modal.equations import block_diagonal
from boomctl.rotating_beam.modal.first_order import FirstOrderEquations
from boomctl.rotating_beam.modal.foam import foam
from boomctl.rotating_beam.modal.integrals import ModalIntegrals


def tlam(integrals: ModalIntegrals) -> FirstOrderEquations:
    """TLAM, FOAM of Bai et al. (2009) without the underlined terms in Eqs. (25), (31) and (32): no matrix D."""
    whole = foam(integrals)
    shapeless = whole.tip._replace(shortening=np.zeros_like(whole.tip.shortening))
    return replace(whole, N=block_diagonal(integrals.M1, integrals.M2), tip=shapeless)
