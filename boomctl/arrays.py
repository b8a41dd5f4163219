"""Names for the kinds of arrays that signatures speak of."""

from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray[Any, Any]
"""An array of numbers; the docstring says whether real or complex, and of which shape."""

Matrix: TypeAlias = Any
"""A real matrix, ``numpy.ndarray`` or ``scipy.sparse.csr_array``."""
