"""Modal truncation with static correction: the strongest modes stay, the others answer as they do at rest."""

import numpy as np

from boomctl.arrays import Array
from boomctl.lti.modal import ModalSystem
from boomctl.lti.system import Lti


def modal_reduced(modal: ModalSystem, order: int, band: tuple[float, float] | None = None) -> tuple[Lti, float]:
    """Return the strongest modes with the static gain of the others, and a bound of the error.

    A pair of poles is kept whole, so that the order may come out one less than asked for.  What a mode lacks after
    the correction, ``c b s/(p (s - p))``, is at most ``|c| |b|/|Re p|``, which is what the modes are ranked by; with a
    band, by the most they reach within it, and the correction is the real part of what they give in its middle.
    """
    kept = _strongest(modal, order, modal.sizes if band is None else _sizes_within(modal, band))
    gone = modal.only(~kept)
    centre = 0.0 if band is None else float(np.sqrt(max(band[0], 0.01 * band[1]) * band[1]))
    share = np.real((gone.C / (1j * centre - gone.poles)) @ gone.B)
    reduced = modal.only(kept).blocks
    bound = float(gone.sizes.sum()) * (1.0 if band is None else 2.0)
    return Lti(reduced.A, reduced.B, reduced.C, modal.D + share), bound


def _sizes_within(modal: ModalSystem, band: tuple[float, float]) -> Array:
    nearest = np.clip(np.abs(modal.poles.imag), *band)
    lengths = np.linalg.norm(modal.C, axis=0) * np.linalg.norm(modal.B, axis=1)
    return lengths / np.hypot(modal.poles.real, nearest - np.abs(modal.poles.imag))


def _strongest(modal: ModalSystem, order: int, sizes: Array) -> Array:
    kept = np.zeros(len(modal.poles), dtype=bool)
    left = order
    for i in np.argsort(-sizes, kind="stable"):
        pole = modal.poles[i]
        if pole.imag < 0.0 or (pole.imag == 0.0 and left < 1) or (pole.imag > 0.0 and left < 2):
            continue
        kept[i] = True
        left -= 1
        if pole.imag > 0.0:
            kept[i + 1] = True
            left -= 1
    return kept
