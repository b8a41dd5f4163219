"""Modal integrals of beam and point mass, Eqs. (13)-(20) and (A1)-(A8) of Bai et al. (2009)."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from boomctl.arrays import Array
from boomctl.printing import compact
from boomctl.rotating_beam.modal.shapes import axial_modes, transverse_modes
from boomctl.rotating_beam.parameters import HubBeamParameters


@dataclass(frozen=True)
class ModalIntegrals:
    """Constant matrices of the models; 1 is axial, 2 transverse, n modes each; the point mass is included.

    Attributes
    ----------
    inertia : float
        ``J_h + J_b`` with the point mass, kg m^2 (Eq. 13).
    M1, M2 : ndarray, n x n
        Masses, kg (Eq. 16).
    K1, K2 : ndarray, n x n
        Stiffnesses, N/m (Eqs. 14, 15).
    C1, C2 : ndarray, n x n
        Dampings, N s/m: the same damping ratio for every clamped mode at rest.
    V1, V2 : ndarray, n
        ``int rhoA (r_A + x) f dx``, kg m (Eq. 17).
    D : ndarray, n x n
        ``int rhoA (r_A + x) S(x) dx``, kg (Eq. 18).
    R : ndarray, n x n
        ``int rhoA f_1^T f_2 dx``, kg (Eq. 19).
    tip1, tip2 : ndarray, n
        Shapes at the free end.
    S_tip : ndarray, n x n
        S(L), 1/m (Eq. 20).
    """

    inertia: float
    M1: Array
    K1: Array
    C1: Array
    V1: Array
    M2: Array
    K2: Array
    C2: Array
    V2: Array
    D: Array
    R: Array
    tip1: Array
    tip2: Array
    S_tip: Array

    __repr__ = compact


@dataclass(frozen=True)
class MassPoints:
    """Mass of the beam at Gauss points and the point mass, for sums that represent integrals of fourth order.

    Attributes
    ----------
    mass : ndarray, k
        Mass at each point, kg.
    radius : ndarray, k
        Distance ``r_A + x`` from the axis, m.
    f1, f2 : ndarray, k x n
        Shapes.
    S : ndarray, k x n x n
        ``S(x)``, 1/m.
    """

    mass: Array
    radius: Array
    f1: Array
    f2: Array
    S: Array

    __repr__ = compact


def modal_integrals(parameters: HubBeamParameters, modes: int) -> ModalIntegrals:
    """Compute the modal integrals to 1e-12 or better for up to 200 modes.

    The accuracy is relative to each entry, except for entries of D far from the diagonal, which are small differences: it
    is relative to ``sqrt(D_ii D_jj)``.

    ``M, K, V, S`` and R except its diagonal have closed forms; the diagonal and D are summed over Gauss points, with the
    order of integration in D swapped: ``D = int f_2'^T f_2' [int_x^L rhoA (r_A + s) ds] dx``.

    Parameters
    ----------
    parameters : HubBeamParameters
    modes : int
        Number of transverse and of axial modes.
    """
    p = parameters
    unit = _unit_integrals(modes, p._mass_position / p.length)
    line, mass, radius = p.mass_per_length, p.tip_mass, p.hub_radius + p._mass_position
    a, b = unit.axial / p.length, unit.transverse / p.length

    M1 = 0.5 * line * p.length * np.eye(modes) + mass * np.outer(unit.at1, unit.at1)
    M2 = line * p.length * np.eye(modes) + mass * np.outer(unit.at2, unit.at2)
    K1 = np.diag(0.5 * p.axial_stiffness * p.length * a**2)
    K2 = np.diag(p.bending_stiffness * p.length * b**4)
    C1, C2 = (_modal_damping(M, K, p.damping_ratio) for M, K in ((M1, K1), (M2, K2)))
    return ModalIntegrals(
        inertia=p.rigid_body_inertia,
        M1=M1,
        K1=K1,
        C1=C1,
        V1=line * p.length * (p.hub_radius * unit.V1[0] + p.length * unit.V1[1]) + mass * radius * unit.at1,
        M2=M2,
        K2=K2,
        C2=C2,
        V2=line * p.length * (p.hub_radius * unit.V2[0] + p.length * unit.V2[1]) + mass * radius * unit.at2,
        D=line * (p.hub_radius * unit.D[0] + p.length * unit.D[1]) + mass * radius * unit.S_at / p.length,
        R=line * p.length * unit.R + mass * np.outer(unit.at1, unit.at2),
        tip1=unit.tip1.copy(),
        tip2=unit.tip2.copy(),
        S_tip=unit.S_tip / p.length,
    )


class _UnitIntegrals(NamedTuple):
    """Integrals of a beam of unit length and density; those of hub radius and of length are separate.

    Attributes
    ----------
    axial, transverse : ndarray, n
        Wavenumbers.
    V1, V2, D : pair of ndarray
        Terms for a unit hub radius, and of the beam itself.
    R : ndarray, n x n
    at1, at2, tip1, tip2 : ndarray, n
        Shapes at the point mass and at the free end.
    S_at, S_tip : ndarray, n x n
        S there.
    """

    axial: Array
    transverse: Array
    V1: tuple[Array, Array]
    V2: tuple[Array, Array]
    D: tuple[Array, Array]
    R: Array
    at1: Array
    at2: Array
    S_at: Array
    tip1: Array
    tip2: Array
    S_tip: Array


@lru_cache(maxsize=16)  # of a parameter study; 2 MB each for 200 modes
def _unit_integrals(modes: int, position: float) -> _UnitIntegrals:
    """Compute the integrals of a beam of unit length with the point mass at a position."""
    f1, f2 = axial_modes(modes, 1.0), transverse_modes(modes, 1.0)
    # by parts with f'''' = b^4 f only terms at the ends remain in integrals, but where two wavenumbers nearly agree
    a, b, odd = f1.wavenumbers, f2.wavenumbers, np.where(np.arange(modes) % 2 == 0, 1.0, -1.0)
    x, weights = gauss_points(1.0, 0.5 * b[-1])
    derivatives = f2(x, 1)
    D = tuple(derivatives.T @ ((weights * outside)[:, None] * derivatives) for outside in (1.0 - x, 0.5 * (1.0 - x**2)))
    row, gap = a[:, None], a[:, None] - b
    np.fill_diagonal(gap, 1.0)
    R = 2.0 * row * b * (np.outer(odd, odd * f2.sine) * row - b) / (gap * (row + b) * (row**2 + b**2))
    np.fill_diagonal(R, weights @ (f1(x) * f2(x)))
    return _UnitIntegrals(
        axial=a,
        transverse=b,
        V1=(1.0 / a, odd / a**2),
        V2=(2.0 * f2.sine / b, 2.0 / b**2),
        D=(D[0], D[1]),
        R=R,
        at1=f1(position),
        at2=f2(position),
        S_at=f2.shortening(position),
        tip1=f1(1.0),
        tip2=f2(1.0),
        S_tip=f2.shortening(1.0),
    )


def mass_points(parameters: HubBeamParameters, modes: int) -> MassPoints:
    """Place the beam's mass in Gauss points that sum products of four derivatives exactly to rounding.

    Parameters
    ----------
    parameters : HubBeamParameters
    modes : int
        Number of transverse and of axial modes.
    """
    p = parameters
    f1, f2 = axial_modes(modes, p.length), transverse_modes(modes, p.length)
    x, weights = gauss_points(p.length, f2.wavenumbers[-1] * p.length)
    mass = p.mass_per_length * weights
    if p.tip_mass > 0.0:
        x, mass = np.append(x, p._mass_position), np.append(mass, p.tip_mass)
    return MassPoints(mass, p.hub_radius + x, f1(x), f2(x), f2.shortening(x))


_legendre_points = lru_cache(maxsize=16)(leggauss)  # scipy.special has them too, but takes 0.2 s to import


def gauss_points(length: float, phase: float) -> tuple[Array, Array]:
    """Gauss-Legendre points and weights on [0, length] that integrate ``cos(4 phase x / length)`` to rounding."""
    count = int(np.ceil(1.05 * phase + 4.0 * phase ** (1.0 / 3.0))) + 12
    points, weights = _legendre_points(count)
    return 0.5 * length * (points + 1.0), 0.5 * length * weights


def _modal_damping(mass: Array, stiffness: Array, ratio: float) -> Array:
    """``2 ratio M sqrt(M^-1 K)``."""
    if ratio == 0.0:
        return np.zeros_like(mass)
    from scipy.linalg import eigh

    squares, shapes = eigh(mass, stiffness)  # the low frequencies are the large, exact ones
    momentum = mass @ shapes  # shapes^T K shapes = 1, shapes^T M shapes = squares = 1 / omega^2
    omega = 1.0 / np.sqrt(squares)
    return (momentum * (2.0 * ratio * omega**3)) @ momentum.T
