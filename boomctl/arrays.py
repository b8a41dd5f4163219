"""Names for the kinds of arrays that signatures speak of, and where matrices become sparse."""

from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray[Any, Any]
"""An array of numbers; the docstring says whether real or complex, and of which shape."""

Matrix: TypeAlias = Any
"""A real matrix, ``numpy.ndarray`` or, with more than :data:`DENSE_LIMIT` coordinates, ``scipy.sparse.csr_array``."""

DENSE_LIMIT = 64  # coordinates up to which matrices are dense: a sparse product of that size costs more (measured)
