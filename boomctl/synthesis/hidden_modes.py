"""Refusals that name the unstable or undamped mode that no control moves and no measurement or weight sees.

Modes that decay may stay as they are.
"""

from collections.abc import Sequence

from boomctl.arrays import Array
from boomctl.lti.hidden_modes import unmoved
from boomctl.synthesis.errors import SynthesisError


def check_stabilizable(A: Array, B: Array, controls: Sequence[str], states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming an unstable or undamped mode that the controls cannot move."""
    for mode in unmoved(A, B, states):
        raise SynthesisError(f"{mode} cannot be moved by {_listed(controls)}, and it does not decay by itself")


def check_detectable(A: Array, C: Array, measurements: Sequence[str], states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming an unstable or undamped mode that no measurement sees."""
    for mode in unmoved(A.T, C.T, states):
        raise SynthesisError(f"{mode} is not seen by {_listed(measurements)}, and it does not decay by itself")


def check_weighted(A: Array, root: Array, what: str, states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming a mode on the imaginary axis that the weight ``root root^T`` does not see."""
    for mode in unmoved(A.T, root, states, axis_only=True):
        raise SynthesisError(f"{mode} is undamped and not seen by {what}: weigh a state or output in which it shows")


def check_excited(A: Array, root: Array, what: str, states: Sequence[str]) -> None:
    """Raise :class:`SynthesisError` naming a mode on the imaginary axis that the noise ``root root^T`` does not reach."""
    for mode in unmoved(A, root, states, axis_only=True):
        raise SynthesisError(
            f"{mode} is undamped and not reached by {what}: the estimator would trust its model of it for ever"
        )


def _listed(signals: Sequence[str]) -> str:
    return ", ".join(signals) if signals else "any control"
