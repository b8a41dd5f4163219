"""A flexible robot: lumped masses on light beams, where Anthonis & Ramon (2003) expect discrete elements to do better.

A straight arm of two equal links, clamped at the shoulder, with a motor at the elbow and a payload at the tip, both point
masses.  How many times heavier these are than the beam is the parameter; without them the arm is the plain beam on which
textbooks compare mass matrices.
"""

from collections.abc import Iterator
from functools import cache, partial
from math import inf
from typing import Any

import mpmath as mp
import numpy as np
from scipy.linalg import eigh

from boomctl.arrays import Array
from boomctl.lab.benchmark.diagram import Diagram
from boomctl.lab.benchmark.promise import Promise
from boomctl.lab.benchmark.references.high_precision import MASS, STIFFNESS, carried
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, asked
from boomctl.structure.assembly import Assembly
from boomctl.structure.beams.eigenvalues import undamped_frequencies
from boomctl.structure.beams.elements import DiscreteElements, FiniteElements
from boomctl.structure.parts import GROUND, Beam, BeamSection, Discretization, RigidBody, fixed

_LINK, _BEAM_MASS, _STIFFNESS = 1.0, 1.0, 100.0  # m, kg of both links, N m^2: of an arm of 2 m (a choice)
_MOTOR = 0.6  # share of the lumped mass that is at the elbow (a choice)
_MODES = 2  # as many as there are lumped masses: those that stay slow where the beam is light
_DIGITS = 40  # of the reference
_SIZES: dict[Extent, tuple[int, ...]] = {"quick": (1, 4), "whole": (1, 2, 3, 4, 8, 16, 32)}  # a link
_ORDERS: dict[Extent, tuple[int, ...]] = {"quick": (4, 6), "whole": (4, 5, 6, 7, 8, 10, 12)}

FINITE, DISCRETE = "finite elements", "discrete elements, lumped"
"""What the paper's closing claim compares."""


_LEVELS = (1e-2, 1e-3, 1e-6)  # errors for which unknowns are counted
_HEAVY = 100.0  # times the beam's mass, from which on the claim is taken at its word (a choice)
_CLAIMED = 1e-2  # error of what the claim is about: a structure of a few masses (a choice)
_SHARE = 0.2  # of the seconds of a scene: one small question of five


def _unknowns(error: float, ratio: float) -> Promise:
    """Tell the unknowns that discrete elements need over those of finite ones; where the claim is meant, promise no more."""

    def read(diagram: Diagram) -> float | None:
        discrete, finite = (
            min((p.size for p in diagram.competitors.get(name, ()) if p.error <= error and p.size), default=inf)
            for name in (DISCRETE, FINITE)
        )
        return discrete / finite if finite < inf else None

    bound = 1.0 if ratio >= _HEAVY and error == _CLAIMED else None
    return Promise(f"unknowns for {error:g}: {DISCRETE} over {FINITE}", read, bound)


def lumped_masses(times: str, extent: Extent) -> Scene:
    """Return the scene of an arm whose lumped masses are so many times heavier than its beam."""
    ratio = float(times)
    true = cache(lambda: exact_frequencies(ratio))
    return Scene(
        key=f"lumped-masses-{times}",
        title=f"Flexible robot, lumped masses {times} times the beam's",
        question="From masses and stiffness of an arm of two light links, with a motor at the elbow and a payload at the tip,"
        f" to its first {_MODES} natural frequencies.",
        measure=f"Largest relative error of these frequencies, against the exact beam in {_DIGITS} digits.",
        settings=(*_ours(ratio, extent), *_others(ratio, extent)),
        error=lambda found: float(np.abs(np.asarray(found) / true() - 1.0).max()),
        remarks=(
            "Anthonis & Ramon (2003) close with: 'Structures consisting of undeformable masses, interconnected by beams with"
            " negligible mass, fit better to the discrete element approach.' Discrete elements are massless cubic beams with"
            " half of each element's mass at either end, finite elements have the consistent mass matrix.",
            "Unknowns are those that move with a mass of their own: both deflection and slope of a node of finite elements,"
            " the deflection alone of a node of lumped discrete elements.",
            "Where others are ahead: with so few unknowns all of the run time is Python. Ours reads a description of the arm,"
            " checks it, assembles rows and names, finds damped poles and estimates their rounding; eigh is given matrices.",
            "SciPy's eigh is given the same matrices by plain NumPy code; lumped ones with the slopes eliminated.",
        ),
        promises=tuple(_unknowns(error, ratio) for error in _LEVELS),
        shows="unknowns",
        share=_SHARE,
    )


def _masses(ratio: float) -> tuple[float, float]:
    """Return motor and payload, kg."""
    return _MOTOR * ratio * _BEAM_MASS, (1.0 - _MOTOR) * ratio * _BEAM_MASS


def exact_frequencies(ratio: float) -> Array:
    """Return the natural frequencies of the exact arm [rad/s]: roots of its determinant, started at ours.

    From the clamp, moment and force are carried over both links by the functions of ``w'''' = beta^4 w``; at the tip the
    moment is to vanish, and the force to be that of the payload.
    """
    starts = undamped_frequencies(_arm(ratio, 0.0, FiniteElements(1)).exact(), _MODES)
    motor, payload = _masses(ratio)
    with mp.workdps(_DIGITS):
        mass, stiffness = mp.mpf(_BEAM_MASS) / (2 * _LINK), mp.mpf(_STIFFNESS)

        def determinant(omega: Any) -> Any:
            beta = mp.sqrt(omega * mp.sqrt(mass / stiffness))
            link = carried(beta, mp.mpf(_LINK))
            state = link[:, 2:]  # of a unit moment, and a unit force, at the clamp
            state[3, :] += motor * omega**2 / stiffness * state[0, :]  # E I w''' jumps by what accelerates the motor
            state = link * state
            state[3, :] += payload * omega**2 / stiffness * state[0, :]
            return mp.det(state[2:, :])

        return np.array([float(mp.findroot(determinant, mp.mpf(float(start)))) for start in starts])


def _arm(ratio: float, change: float, mesh: Discretization) -> Assembly:
    """Return the arm, its stiffness changed."""
    section = BeamSection(_LINK, _BEAM_MASS / (2 * _LINK), _STIFFNESS * (1.0 + change))
    beam = Beam("arm", GROUND.at(0.0), fixed(), (0.0, 0.0), (section, section), mesh)
    motor, payload = _masses(ratio)
    lumped = [
        RigidBody(name, beam.at(x), fixed(), mass)
        for name, x, mass in (("motor", _LINK, motor), ("payload", 2 * _LINK, payload))
    ]
    return Assembly((beam, *lumped))


def _frequencies(model: Any) -> Array:
    return 2.0 * np.pi * model.eigenfrequencies_hz(_MODES)


def _ours(ratio: float, extent: Extent) -> Iterator[Setting]:
    meshes: list[tuple[str, str, Discretization, int, str]] = []
    for n in _SIZES[extent]:
        label = f"{2 * n} elements"
        meshes += [
            (FINITE, label, FiniteElements(2 * n), 4 * n, f"s.FiniteElements({2 * n})"),
            (DISCRETE, label, DiscreteElements(2 * n, "lumped"), 2 * n, f's.DiscreteElements({2 * n}, "lumped")'),
        ]
    for k in _ORDERS[extent]:
        words = f"s.FiniteElements(2, order={k})"
        meshes.append(("high-order elements", f"order {k}", FiniteElements(2, k), 2 * (k - 1), words))
    for name, label, mesh, size, words in meshes:
        yield asked(
            name,
            label,
            lambda change, mesh=mesh: _arm(ratio, change, mesh).assemble(),
            _frequencies,
            ours=True,
            call=f"s.Assembly((s.Beam(..., {words}), motor, payload)).assemble().eigenfrequencies_hz({_MODES})",
            size=size,
        )
    yield Setting(
        "exact beam",
        "exact",
        ours=True,
        cold=lambda change: undamped_frequencies(_arm(ratio, change, FiniteElements(1)).exact(), _MODES),
    )


def _others(ratio: float, extent: Extent) -> Iterator[Setting]:
    for name, lumped in (("SciPy, eigh, consistent masses", False), ("SciPy, eigh, lumped masses", True)):
        for n in _SIZES[extent]:
            made = partial(_plain_matrices, ratio, 2 * n, lumped)
            yield asked(name, f"{2 * n} elements", made, _by_eigh, size=2 * n if lumped else 4 * n)


def _by_eigh(matrices: tuple[Array, Array]) -> Array:
    M, K = matrices
    last = min(_MODES, len(M)) - 1
    found = np.sqrt(eigh(K, M, eigvals_only=True, subset_by_index=[0, last]))
    return found if len(found) == _MODES else np.full(_MODES, np.nan)


def _plain_matrices(ratio: float, elements: int, lumped: bool, change: float) -> tuple[Array, Array]:
    """Return ``M, K`` of the arm by cubic elements over deflections and slopes, clamped, as textbooks have them."""
    h = 2 * _LINK / elements
    rho, stiffness = _BEAM_MASS / (2 * _LINK), _STIFFNESS * (1.0 + change)
    scale = np.array([1.0, h, 1.0, h])
    M, K = (np.zeros((2 * elements + 2,) * 2) for _ in range(2))
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        M[at, at] += np.outer(scale, scale) * MASS * rho * h / 420
        K[at, at] += np.outer(scale, scale) * STIFFNESS * stiffness / h**3
    motor, payload = _masses(ratio)
    deflections, slopes = np.arange(2, 2 * elements + 2, 2), np.arange(3, 2 * elements + 2, 2)
    if lumped:
        masses = np.full(elements, rho * h)
        masses[-1] = 0.5 * rho * h
        into = K[np.ix_(slopes, deflections)]
        K = K[np.ix_(deflections, deflections)] - into.T @ np.linalg.solve(K[np.ix_(slopes, slopes)], into)
        M, motor_at, tip_at = np.diag(masses), elements // 2 - 1, elements - 1
    else:
        M, K, motor_at, tip_at = M[2:, 2:], K[2:, 2:], elements - 2, 2 * elements - 2
    M[motor_at, motor_at] += motor
    M[tip_at, tip_at] += payload
    return M, K
