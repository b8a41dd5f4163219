"""What the scenes of the boom have in common: the machine, our meshes of it, and how other programs are asked."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.peers.plain_boom import PlainBoom
from boomctl.lab.benchmark.scene import Setting, asked
from boomctl.lti.python_control import control

MESHES = {"quick": (6, 20), "whole": (4, 6, 10, 20, 50, 100, 200)}
"""Numbers of elements that other programs are asked with: more take minutes with dense matrices."""
_SPANS = 4  # high-order elements: one between each two of tip, spring, hinge, spring, tip
_NAMES = {"finite": "finite elements", "high-order": "high-order elements"}


def varied(p: BoomParameters, change: float) -> BoomParameters:
    """Return parameters with another spring."""
    return replace(p, spring_stiffness=p.spring_stiffness * (1.0 + change))


def our_boom(p: BoomParameters, change: float, **options: Any) -> Any:
    """Return this package's model of the boom with another spring."""
    return spray_boom(varied(p, change), **options)


def our_mesh(
    p: BoomParameters, kind: str, size: int, ask: Callable[[Any], Any], call: str, label: str = "{} {}"
) -> Setting:
    """Return this package's setting of a mesh: of so many elements, or of high-order ones of an order.

    Parameters
    ----------
    p : BoomParameters
    kind : str
        The discretisation.
    size : int
        Elements, or the order.
    ask : callable
        Takes the model to the answer.
    call : str
        What a user writes, with ``{}`` where the boom stands.
    label : str
        Of the setting, with ``{}`` for what counts, "elements" or "order", and for the size.
    """
    counted = "order" if kind == "high-order" else "elements"
    options = {"elements": _SPANS, "order": size} if kind == "high-order" else {"elements": size}
    words = ", ".join(f"{name}={value}" for name, value in options.items())
    made = partial(our_boom, p, discretization=kind, **options)
    written = call.format(f'bc.spray_boom(p, "{kind}", {words})')
    return asked(_NAMES.get(kind, f"{kind} elements"), label.format(counted, size), made, ask, ours=True, call=written)


def boom_peer(
    p: BoomParameters,
    name: str,
    label: str,
    elements: int,
    made: Callable[[PlainBoom], Any],
    ask: Callable[[Any], Any],
) -> Setting:
    """Return a setting of another program: what it makes of a plain boom, and what it is asked; cold with both in it."""
    return asked(name, label, lambda change: made(PlainBoom.of(varied(p, change), elements)), ask)


def control_boom(boom: PlainBoom) -> control.StateSpace:
    """Return python-control's system of a plain boom."""
    return control.ss(*boom.statespace())


def control_sigma(system: control.StateSpace, omega: Array) -> Array:
    """Return the singular values of python-control's system."""
    return np.abs(np.asarray(control.singular_values_response(system, omega).frdata)[:, 0])


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
