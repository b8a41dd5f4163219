"""Names for the kinds of arrays that signatures speak of."""

from typing import Any, TypeAlias

import numpy as np

__all__ = ["Array", "Complex", "Flags", "Indices", "Matrix"]

Array: TypeAlias = np.ndarray[Any, Any]
"""Real numbers."""

Complex: TypeAlias = np.ndarray[Any, Any]
"""Complex numbers."""

Indices: TypeAlias = np.ndarray[Any, Any]
"""Places in another array."""

Flags: TypeAlias = np.ndarray[Any, Any]
"""True or False."""

Matrix: TypeAlias = Any
"""A real matrix, ``numpy.ndarray`` or ``scipy.sparse.csr_array``."""
