"""Relative rounding errors, and the three tolerances of results.

Each relative error is defined once; the other factor where it is used is the reference, such as the norm of a matrix, the
fastest pole, or the terms of a sum.  A bound that a proof needs for a single computation is defined at that computation.
"""

import numpy as np

from boomctl.arrays import SUMMED as SUMMED
from boomctl.checks import warn_user
from boomctl.exceptions import AccuracyWarning

EPS = float(np.finfo(float).eps)  # Unit roundoff: distance of one from the next double.
# Rounding error of a few operations, relative to their result; of a solver, relative to the norm of its matrix.
DIGIT = 4.0 * EPS
TINY = float(np.finfo(float).tiny)  # Least number of full precision.
# Rounding error of a sum or product of input entries, relative to its terms.
CANCELLED = 8.0 * EPS
COMPUTED = 1e-14  # Rounding error of a short chain of operations, relative to the largest number: 50 units.
SOLVED = 1e-13  # Rounding error of a chain of decompositions, relative to the largest number: 500 units.
ALIKE = 1e-9  # Relative difference up to which numbers from data or an assembly are equal: far above rounding.
# Pivot, singular value, residue or remainder, relative to the largest, below which it is rounding of its terms.
DEPENDENT = 1e-10
UNDERFLOW = 1e-150  # Numbers below it have squares that underflow; those of numbers above its inverse overflow.
ROOT = 1e-7  # Square root of rounding, with a margin: perturbation of a double root, relative to the largest one.

# Number of states up to which exact polynomials are used where an inequality does not decide; larger systems take too long.
EXACT_STATES = 40
CERTIFIED = 1e-5  # Relative gap of two bounds up to which a norm is certified.
# A tenth of CERTIFIED: relative distance of a tested level above the largest known gain, and relative difference up to which
# responses, norms of two methods, and sample times given in decimals are equal.
LEVEL = 1e-6
VISIBLE = 1e-4  # Fraction of the largest response that is visible in a plot.


def warn_of_rounding(what: str, error: float, limit: float) -> None:
    """Warn if the relative rounding error ``error`` of a result exceeds ``limit``."""
    if error > limit:
        message = f"rounding of {what} may change it by {error:.1g} (relative)"
        warn_user(f"{message}, more than the usual {limit:.0e}", AccuracyWarning)
