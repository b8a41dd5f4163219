"""Mirror symmetry: a symmetric structure splits into a symmetric and an antisymmetric half."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from boomctl.arrays import Array
from boomctl.printing import compact
from boomctl.structure.elimination import Elimination

_PROBE = 0.7390851332151607  # [rad], for numbers without a pattern: the angle that is its own cosine


@dataclass(frozen=True)
class SignalPair:
    """A signal and its mirror image; ``left`` is None for a signal that is its own image (or minus it: parity -1)."""

    stem: str
    right: str
    left: str | None = None
    parity: int = 1


@dataclass(frozen=True, eq=False)
class Mirror:
    """The reflection ``x -> -x``: coordinate ``i`` becomes ``sign[i]`` times coordinate ``partner[i]``."""

    partner: Array
    sign: Array
    pairs: tuple[SignalPair, ...]

    __repr__ = compact

    def restricted(self, choice: Elimination) -> "Mirror | None":
        """Return the mirror of the independent coordinates, or None if the elimination was not symmetric."""
        independent = choice.independent
        new = np.full(len(self.partner), -1)
        new[independent] = np.arange(len(independent))
        partner = new[self.partner[independent]]
        if (partner < 0).any():
            return None
        return Mirror(partner, self.sign[independent], self.pairs)

    def representatives(self, parity: int) -> Array:
        """Return one coordinate for each motion of the given parity: the first of a pair, or the one on the axis."""
        here = np.arange(len(self.partner))
        return np.flatnonzero((self.partner > here) | ((self.partner == here) & (self.sign == parity)))

    def basis(self, parity: int) -> Array:
        """Return orthonormal columns that span the motions of the given parity (+1 symmetric, -1 antisymmetric)."""
        first = self.representatives(parity)
        image, here = self.partner[first], np.arange(len(first))
        paired = image != first
        P = np.zeros((len(self.partner), len(first)))
        P[first, here] = np.where(paired, np.sqrt(0.5), 1.0)
        P[image[paired], here[paired]] = (parity * np.sqrt(0.5)) * self.sign[first[paired]]
        return P

    def half_coordinates(self, coordinates: Sequence[str], parity: int) -> tuple[str, ...]:
        """Return the names of the coordinates of a half."""
        return tuple(f"{coordinates[i]}_{'sym' if parity > 0 else 'anti'}" for i in self.representatives(parity))

    @cached_property
    def probe(self) -> Array:
        """A motion without any symmetry, and its reflection, as columns."""
        motion = 1.0 + 0.5 * np.cos(_PROBE * np.arange(len(self.sign)) ** 2)
        return np.array([motion, self.reflect(motion)]).T

    def reflect(self, motion: Array) -> Array:
        """Return a motion, one number a coordinate, as it looks in the mirror."""
        return self.sign * motion[..., self.partner]

    def change(self, forces: Array) -> float:
        """Return how much forces of motions :attr:`probe`, (kinds, n, 2), differ from their reflection, of the largest."""
        largest = np.abs(forces).max(axis=(1, 2), initial=0.0)
        change = np.abs(self.reflect(forces[:, :, 1]) - forces[:, :, 0]).max(axis=1, initial=0.0)
        return float((change / np.where(largest > 0.0, largest, 1.0)).max())

    def completed(self, wanted: Sequence[str], available: Sequence[str]) -> tuple[str, ...]:
        """Return the signals wanted and, behind them, the mirror images that they lack."""
        partner = {
            a: b for pair in self.pairs if pair.left for a, b in ((pair.right, pair.left), (pair.left, pair.right))
        }
        lacking = [partner[name] for name in wanted if partner.get(name, name) not in wanted]
        return (*wanted, *(name for name in lacking if name in available))

    def signals(self, names: Sequence[str], parity: int) -> tuple[Array, tuple[str, ...]] | None:
        """Return the matrix from half signals to full ones, and the half signals' names; None if an image lacks."""
        return _half_signals(self, tuple(names), parity)


@lru_cache
def _half_signals(mirror: Mirror, names: tuple[str, ...], parity: int) -> tuple[Array, tuple[str, ...]] | None:
    columns, stems, covered = [], [], set()
    for pair in mirror.pairs:
        sides = (pair.right,) if pair.left is None else (pair.right, pair.left)
        have = [name for name in sides if name in names]
        if have and len(have) < len(sides):
            return None
        covered.update(have)
        if not have or (pair.left is None and pair.parity != parity):
            continue
        column = np.zeros(len(names))
        column[[names.index(name) for name in sides]] = 1.0 if pair.left is None else np.sqrt([0.5, 0.5]) * (1, parity)
        columns.append(column)
        stems.append(pair.stem if pair.left is None else f"{pair.stem}_{'sym' if parity > 0 else 'anti'}")
    if covered != set(names):
        return None
    W = np.array(columns).reshape(-1, len(names)).T
    W.setflags(write=False)
    return W, tuple(stems)


def beam_reflection(names: Sequence[str], nodes: int) -> Mapping[str, tuple[str, int]]:
    """Return, for the local coordinates of a beam of ``nodes`` nodes, name -> (mirror name, sign)."""
    images = {}
    for name in names:
        kind, number = name.rstrip("0123456789"), int(name[len(name.rstrip("0123456789")) :])
        if kind.startswith("b"):
            images[name] = (f"{kind}{nodes - 2 - number}", (-1) ** int(kind[1:-1]))
        else:
            images[name] = (f"{kind}{nodes - 1 - number}", 1 if kind == "w" else -1)
    return images


def mirror_of(
    coordinates: Sequence[str], images: Mapping[str, tuple[str, int]], pairs: tuple[SignalPair, ...]
) -> Mirror | None:
    """Return the mirror that ``images`` (coordinate -> (image, sign)) describes; None if an image is missing."""
    index = {name: i for i, name in enumerate(coordinates)}
    if any(images[name][0] not in index for name in coordinates):
        return None
    partner = np.array([index[images[name][0]] for name in coordinates])
    return Mirror(partner, np.array([float(images[name][1]) for name in coordinates]), pairs)
