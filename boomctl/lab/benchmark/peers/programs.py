"""Other programs: which are installed, and the pieces of them that several scenes use."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.plain_boom import PlainBoom

MESHES = {"quick": (6, 20), "whole": (4, 6, 10, 20, 50, 100, 200)}
"""Numbers of elements that other programs are asked with: more take minutes with dense matrices."""


def missing(**needed: str) -> tuple[str, ...]:
    """Return what is to be said of modules that are not installed: name of the peer, by the module it needs."""
    return tuple(
        f"{peer.replace('_', ' ')}: {module} is not installed" for peer, module in needed.items() if not there(module)
    )


def there(module: str) -> bool:
    """Return whether a module can be imported."""
    return find_spec(module) is not None


def pymor_boom(boom: PlainBoom) -> Any:
    """Return pyMOR's descriptor model of a plain boom, sparse, which computes anew whenever it is asked."""
    A, B, C, E = boom.descriptor()
    return pymor_model(A, B, C, None, E)


def pymor_model(A: Any, B: Any, C: Any, D: Any = None, E: Any = None) -> Any:
    """Return pyMOR's model of matrices, which computes anew whenever it is asked, and says nothing."""
    import_module("pymor.core.logger").set_log_levels({"pymor": "ERROR"})
    made = import_module("pymor.models.iosys").LTIModel.from_matrices(A, B, C, D, E)
    made.disable_caching()
    made.transfer_function.disable_caching()
    return made


def sigma_of_response(response: Array) -> Array:
    """Return the singular values over frequency of a response (frequencies, outputs, inputs), descending."""
    return np.linalg.svd(response, compute_uv=False).T
