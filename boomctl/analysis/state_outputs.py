"""Plants whose states are outputs too, for controllers that read states."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from boomctl.lti.system import Lti, of
from boomctl.structure.families import AffineFamily, PolynomialFamily, Slope
from boomctl.structure.model import SecondOrderModel

if TYPE_CHECKING:
    import control


@overload
def with_state_outputs(plant: AffineFamily) -> AffineFamily: ...
@overload
def with_state_outputs(plant: PolynomialFamily) -> PolynomialFamily: ...
@overload
def with_state_outputs(
    plant: "SecondOrderModel | control.StateSpace | control.TransferFunction",
) -> "control.StateSpace": ...
def with_state_outputs(plant: Any) -> "control.StateSpace | AffineFamily | PolynomialFamily":
    """Return the same plant with its states as further outputs, under their names.

    A regulator of :func:`boomctl.lqr` reads states.  Its controller and this plant meet by name, so that
    :func:`boomctl.margins`, :func:`boomctl.feedback_loop` and :func:`boomctl.simulate_loop` take it as they take a controller
    that reads outputs, also sampled and delayed.

    Parameters
    ----------
    plant : SecondOrderModel, AffineFamily, PolynomialFamily, control.StateSpace or control.TransferFunction
        Of p outputs and n states, in continuous or discrete time.  A structure is taken in the states of its
        ``to_statespace()``, which are those that :func:`boomctl.lqr` sees.  Of a family, those of its middle: the same
        sums of places, speeds and displacements of inputs are read at every point of the box.

    Returns
    -------
    control.StateSpace, AffineFamily or PolynomialFamily
        The same inputs and states, a family of a family; first the p outputs, then the n states in their order, dots in
        their names replaced by ``_``.  A state that is an output already, under its name, is not there twice.

    Raises
    ------
    TypeError, ValueError
        Another kind of system, not finite; a state whose name is that of another output, or of another state; a family with
        filters behind its outputs, or integrated inputs.

    Examples
    --------
    >>> import boomctl as bc
    >>> import control
    >>> signals = {"inputs": "force", "outputs": "place", "states": ["x", "v"]}
    >>> mass = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, **signals)
    >>> regulator = bc.lqr(mass, None, 1.0, output_weight={"place": 1.0})
    >>> bc.with_state_outputs(mass).output_labels
    ['place', 'x', 'v']
    >>> margin = bc.margins(bc.with_state_outputs(mass), regulator.controller)["force"]
    >>> bool(margin.phase_margin_deg > 60.0)  # Kalman's inequality
    True
    """
    if isinstance(plant, AffineFamily | PolynomialFamily):
        center = _center_with_state_outputs(plant.nominal)
        more = (
            (0, 0),
            (0, len(center.output_labels) - len(plant.nominal.output_labels)),
            (0, 0),
        )  # what states read stays

        def wider(slope: Slope) -> Slope:
            return replace(slope, L=np.pad(slope.L, more)) if slope.L.any() else replace(slope, L=np.zeros(()))

        return replace(
            plant, nominal=center, coefficients=tuple((power, wider(slope)) for power, slope in plant.coefficients)
        )
    given = of(plant, "plant", "SecondOrderModel, a family, StateSpace or TransferFunction", any_time=True)
    name = getattr(plant, "name", None)
    return _with_state_outputs(given).statespace(name if isinstance(name, str) else "plant")


def _with_state_outputs(plant: Lti) -> Lti:
    plain, eye = plant.without_dots(), np.eye(len(plant.A))
    labels = tuple(label.replace(".", "_") for label in plant.state_labels)

    def same(output: int, state: int) -> bool:
        return bool((plain.C[output] == eye[state]).all() and not plain.D[output].any())

    new = _unread(labels, plain.output_labels, same)
    return replace(
        plain,
        C=np.vstack([plain.C, eye[new]]),
        D=np.vstack([plain.D, np.zeros((len(new), plain.D.shape[1]))]),
        output_labels=(*plain.output_labels, *(labels[i] for i in new)),
    )


def _unread(states: Sequence[str], outputs: Sequence[str], same: Callable[[int, int], bool]) -> list[int]:
    """Return which states are no outputs yet; an output of a state's name that is not the ``same`` is refused."""
    new = []
    for i, label in enumerate(states):
        if label in states[:i]:
            raise ValueError(f"plant: expected states of different names, got {label!r} twice")
        if label not in outputs:
            new.append(i)
        elif not same(outputs.index(label), i):
            raise ValueError(f"plant: expected output {label!r} to be the state of this name; rename one of them")
    return new


def _center_with_state_outputs(model: SecondOrderModel) -> SecondOrderModel:
    """Return a structure whose states, as sums of places, speeds and displacements, are outputs too."""
    ports, n, m = model.ports, model.ncoordinates, len(model.input_labels)
    if any(ports.integrators) or any(bandwidth is not None for bandwidth in ports.bandwidths):
        filtered = [name for name, b in zip(model.output_labels, ports.bandwidths, strict=True) if b is not None]
        which = f"a filter behind {filtered[0]!r}" if filtered else "an input that is integrated"
        raise ValueError(f"plant: expected a family without filters and integrators, got {which}")
    places = replace(
        ports,
        outputs=model.coordinates,
        L=np.stack([np.eye(n), *np.zeros((2, n, n))]),
        E=np.zeros((3, n, m)),
        bandwidths=(None,) * n,
        primary=None,
    )
    x = of(SecondOrderModel.of(model.structure, places), "plant")
    # q = C1 x1 + D d, and x1' = A11 x1 + A12 x2 + B1 d
    C1, D, A11, A12, B1 = x.C[:, :n], x.D, x.A[:n, :n], x.A[:n, n:], x.B[:n]
    if x.C[:, n:].any():
        raise ArithmeticError("with_state_outputs: expected places that are sums of the first half of the states")
    T, inner = np.linalg.inv(C1), np.linalg.inv(A12)
    L, E = np.zeros((3, 2 * n, n)), np.zeros((3, 2 * n, m))
    L[0], L[1, n:] = np.vstack([T, -inner @ A11 @ T]), inner @ T
    E[0], E[1, n:] = np.vstack([-T @ D, inner @ (A11 @ T @ D - B1)]), -inner @ T @ D
    labels = tuple(label.replace(".", "_") for label in x.state_labels)

    def same(output: int, state: int) -> bool:
        return bool((ports.L[:, output] == L[:, state]).all() and (ports.E[:, output] == E[:, state]).all())

    new = _unread(labels, model.output_labels, same)
    read = replace(
        ports,
        outputs=(*model.output_labels, *(labels[i] for i in new)),
        L=np.concatenate([ports.L, L[:, new]], axis=1),
        E=np.concatenate([ports.E, E[:, new]], axis=1),
        bandwidths=(None,) * (len(model.output_labels) + len(new)),
    )
    return SecondOrderModel.of(model.structure, read)
