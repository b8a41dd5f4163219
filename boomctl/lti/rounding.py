"""What rounding leaves, as a share of a size that is named, and the three tolerances of results.

A share stands here once, and where it is used the other factor says of what: of the norm of a matrix, of the fastest pole, of
the terms of a sum.  A number that a proof needs and that holds for one computation alone stands beside that computation.
"""

import numpy as np

from boomctl.checks import warn_user
from boomctl.exceptions import AccuracyWarning

EPS = float(np.finfo(float).eps)  # the unit of rounding: distance of one from the next number
# of a few operations, of their result; of a solver, of the norm of its matrix (measured: below one unit)
DIGIT = 4.0 * EPS
TINY = float(np.finfo(float).tiny)  # the least number of full precision
# of the terms of a sum or product of entries given, up to which it is what their last places leave
CANCELLED = 8.0 * EPS
SOLVED = 1e-13  # of the largest number of a problem, what a chain of decompositions may leave: 500 units (a choice)
SUMMED = 1e-12  # of its terms, up to which an entry of products of whole matrices is rounding: some 1e4 units
ALIKE = 1e-9  # of its size, up to which a number from data or an assembly is another one: far above rounding (a choice)
ROOT = 1e-7  # the root of rounding, with room: by so much of the largest one rounding moves a double value

# up to which exact polynomials prove what an inequality does not; beyond they take too long (measured)
EXACT_STATES = 40
CERTIFIED = 1e-5  # relative distance of two bounds up to which a norm is certified (a choice)
LEVEL = 1e-6  # how far above the largest gain known a level is tried, relative: a tenth of what a norm is certified to
VISIBLE = 1e-4  # of the largest response: what would show in a plot


def warn_of_rounding(what: str, share: float, promised: float) -> None:
    """Warn, if rounding of an answer may be as much as ``share`` of its size and that is more than was ``promised``."""
    if share > promised:
        message = f"rounding of {what} may be as much as {share:.1g} of its size"
        warn_user(f"{message}: more than the {promised:.0e} that is usual", AccuracyWarning)
