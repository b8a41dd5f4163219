"""Block-diagonal form of a matrix: one block a pole or a pair, but for poles too close together to be told apart."""

import numpy as np
import slycot
from scipy import linalg

from boomctl.arrays import Array
from boomctl.lti.rounding import EPS

_DOUBLE = EPS**0.5  # share of a pair's real part below which it may be a double real pole
_WORST = EPS**-0.5  # condition of the change of coordinates: half of all digits are left


def block_diagonal(A: Array, condition: float = _WORST) -> tuple[Array, Array, list[int]]:
    """Return a block-diagonal matrix, the columns that bring ``A`` to it, and the widths of its blocks.

    Where poles lie apart, one call of SLICOT's MB03RD is enough.  Where they do not, ``control.bdschur`` searches for the
    smallest blocks with columns of the condition allowed; that is the answer in the first case too.

    Parameters
    ----------
    A : (n, n) ndarray
        Real.
    condition : float
        Largest condition of the columns.
    """
    if not len(A):
        return A, A, []
    form, vectors = linalg.schur(A)
    # elements of the transformations up to the root of the condition, with which that search begins
    blocks, columns, widths, poles = slycot.mb03rd(len(A), form, vectors, pmax=condition**0.5)
    starts = np.cumsum(widths) - widths
    pairs = poles[starts[widths == 2]]
    apart = (widths <= 2).all() and (np.abs(pairs.imag) >= _DOUBLE * np.abs(pairs.real)).all()
    if not apart or np.linalg.cond(columns) >= condition:
        from boomctl.lti.python_control import control  # two seconds that poles apart do not wait for

        blocks, columns, widths = control.bdschur(A, condmax=condition)
    return np.asarray(blocks), np.asarray(columns), [int(width) for width in widths]
