"""Scenes of synthesis: an H-infinity controller of full order, and gains tuned for two published plants.

Other programs: slycot's SB10AD, and SciPy's simplex search over a gain.
"""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy import linalg
from scipy.optimize import minimize

from boomctl.analysis.model_norm import hinf_norm
from boomctl.arrays import Array
from boomctl.boom.factory import spray_boom
from boomctl.boom.parameters import BoomParameters
from boomctl.files import read_toml
from boomctl.lab.benchmark.scene import Scene, settings, sized
from boomctl.lti.python_control import control
from boomctl.lti.rounding import ROOT
from boomctl.reduction.reduce import reduce
from boomctl.structure.model import split_symmetric
from boomctl.synthesis.hinf.h_infinity import h_infinity
from boomctl.synthesis.plants.generalized import generalized_plant
from boomctl.synthesis.plants.partition import lft
from boomctl.synthesis.plants.scaling import scale_signals
from boomctl.tunable import makers as tunable
from boomctl.tuning.tune import tune

_NMEAS = _NCON = 2  # strokes measured, and forces
_SIDES, _INPUTS, _OUTPUTS = ("sym", "anti"), ("actuator", "suspension"), ("tip", "stroke")
_SCALES = {"actuator": 0.03, "suspension": 150.0, "tip": 0.2, "stroke": 0.05}  # m, N, m, m: what counts as one
_REFERENCE, _FASTEST = 1e-9, 1e9  # tolerance of the design whose proved bound is the reference; rad/s, its fastest pole
_START = 1000.0  # level from which slycot's bisection starts: a guess that is high enough
_BEST = 1.2092993  # least level of this plant, as someone who knows it would tell slycot
_PLANTS = Path(__file__).parents[1] / "plants.toml"
_STARTS = 20  # of the search whose norms are the reference of tuning
_MOST_GAIN = 1e3  # entry of a gain
_OURS: dict[str, Any] = {"verified": True, "ours": True}
_STATES = (8, 16, 32)  # states of the suspension's plant at which run times are compared


@cache
def suspension_plant(order: int = 20) -> control.StateSpace:
    """Return the generalized plant of both halves of the boom, each reduced to half the states."""
    halves = []
    for side, half in zip(_SIDES, split_symmetric(spray_boom(BoomParameters(), elements=20)), strict=True):
        scales = {f"{signal}_{side}": scale for signal, scale in _SCALES.items()}
        chosen = half.select([f"{name}_{side}" for name in _INPUTS], [f"{name}_{side}" for name in _OUTPUTS])
        halves.append(reduce(scale_signals(chosen, scales), order=order // 2).system)
    A, B, C, D = (linalg.block_diag(*(getattr(half, name) for half in halves)) for name in "ABCD")
    ins, outs = ([name for half in halves for name in getattr(half, f"{kind}_labels")] for kind in ("input", "output"))
    platform, controls, tips, strokes = ([f"{n}_{s}" for s in _SIDES] for n in (*_INPUTS, *_OUTPUTS))
    return generalized_plant(
        control.ss(A, B, C, D, inputs=ins, outputs=outs),
        disturbances=dict.fromkeys(platform, 1.0) | dict.fromkeys(controls, 0.05),
        noise=dict.fromkeys(strokes, 0.02),
        performance=dict.fromkeys(tips, 1.0),
        effort=dict.fromkeys(controls, 1.0),
        measurements=strokes,
        controls=controls,
    )


def _faster(P: control.StateSpace, change: float) -> control.StateSpace:
    """Return a plant that is a little faster."""
    return control.ss((1.0 + change) * np.asarray(P.A), P.B, P.C, P.D)


def excess(P: control.StateSpace, bound: float, K: control.StateSpace) -> float:
    """Return how far the norm of the loop lies above a bound, relative to it; infinite if the loop is unstable.

    The norm is SLICOT's (Bruinsma and Steinbuch 1990) to ten digits, as far as our certificate of six allows it.
    """
    loop = lft(P, K)
    if (np.linalg.eigvals(np.asarray(loop.A)).real >= 0.0).any():
        return np.inf
    certified = hinf_norm(loop)
    norm = min(max(control.linfnorm(loop, tol=1e-10)[0], certified.lower_bound), certified.upper_bound)
    return max(norm / bound - 1.0, ROOT)


def h_infinity_scene() -> Scene:
    """Return the scene of the full-order controller."""

    def ours(tolerance: float, fastest: float | None, P: control.StateSpace, change: float) -> control.StateSpace:
        options: dict[str, Any] = {} if fastest is None else {"fastest_pole": fastest}
        return h_infinity(_faster(P, change), _NMEAS, _NCON, rtol=tolerance, **options).controller

    def given(level: float, above: float, P: control.StateSpace, change: float) -> control.StateSpace:
        return h_infinity(_faster(P, change), _NMEAS, _NCON, gamma=level).controller

    def hinfsyn(P: control.StateSpace, change: float) -> control.StateSpace:
        return control.hinfsyn(_faster(P, change), _NMEAS, _NCON)[0]

    def slycot(job: int, level: float, gtol: float, P: control.StateSpace, change: float) -> control.StateSpace:
        return sb10ad(_faster(P, change), _NMEAS, _NCON, job, level, gtol)

    def sized_ours(states: int, P: control.StateSpace, change: float) -> control.StateSpace:
        return ours(1e-3, None, suspension_plant(states), change)

    def sized_slycot(states: int, P: control.StateSpace, change: float) -> control.StateSpace:
        return slycot(1, _START, 1e-3, suspension_plant(states), change)

    cases = [*((tolerance, None) for tolerance in (0.1, 1e-2, 1e-3, 1e-4)), (1e-5, _FASTEST), (1e-7, _FASTEST)]
    levels = [(_BEST * (1.0 + above), above) for above in (0.1, 1e-2, 1e-3, 1e-4)]
    taken = [(4, *level) for level in levels]
    searched = [(1, _START, gtol) for gtol in (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)]
    return Scene(
        title="H-infinity synthesis, order 20",
        question="From the generalized plant of yaw and jolt suspension to a controller.",
        measure=f"Norm of the loop over the proved bound that no controller beats, less one; at least {ROOT:.0e}.",
        problem=suspension_plant,
        reference=lambda P: h_infinity(P, 2, 2, rtol=_REFERENCE, fastest_pole=_FASTEST).certificate.lower_bound,
        error=excess,
        methods=(
            *settings("h_infinity", "rtol {:g}", cases, ours, **_OURS, call="bc.h_infinity(P, 2, 2, rtol={:g})"),
            *settings(
                "h_infinity, given the level",
                "{1:.2%} above the best",
                levels,
                given,
                **_OURS,
                call="bc.h_infinity(P, 2, 2, gamma={0:.7g})",
            ),
            *settings("control.hinfsyn", "defaults", [()], hinfsyn, modules=("slycot",)),
            *settings("slycot sb10ad, bisection", "gtol {2:.0e}", searched, slycot, modules=("slycot",)),
            *settings("slycot sb10ad, given the level", "{2:.2%} above the best", taken, slycot, modules=("slycot",)),
            *sized(
                settings("h_infinity", "{} states", _STATES, sized_ours, **_OURS),
                settings("slycot sb10ad, bisection", "{} states", _STATES, sized_slycot, modules=("slycot",)),
            ),
        ),
        remarks=(
            "Ours verifies the loop and, unless given a level, proves how far from the best it is; slycot computes only.",
            f"slycot's bisection starts at {_START:g}. Tolerances of ours below 1e-4 are with fastest_pole={_FASTEST:g}.",
        ),
    )


def published_plants() -> dict[str, tuple[control.StateSpace, int, int]]:
    """Return generalized plants of COMPleib with their numbers of measurements and controls."""
    result = {}
    for name, matrices in read_toml(_PLANTS).items():
        A, B1, B, C1, C, D12 = (np.asarray(matrices[key], float) for key in ("A", "B1", "B", "C1", "C", "D12"))
        D = np.zeros((len(C1) + len(C), B1.shape[1] + B.shape[1]))
        D[: len(C1), B1.shape[1] :] = D12
        result[name] = control.ss(A, np.hstack([B1, B]), np.vstack([C1, C]), D), len(C), B.shape[1]
    return result


def tuning() -> Scene:
    """Return the scene of gains."""

    def ours(n_starts: int, plants: dict[str, Any], change: float, seed: int = 0) -> dict[str, Any]:
        gain = tunable.gain()
        return {
            name: tune(_faster(P, change), nmeas, ncon, gain, n_starts=n_starts, seed=seed).controller
            for name, (P, nmeas, ncon) in plants.items()
        }

    def theirs(n_starts: int, plants: dict[str, Any], change: float) -> dict[str, Any]:
        return {
            name: control.ss([], [], [], simplex_gain(_faster(P, change), nmeas, ncon, n_starts))
            for name, (P, nmeas, ncon) in plants.items()
        }

    def sized_ours(states: int, plants: dict[str, Any], change: float) -> dict[str, Any]:
        return ours(1, {"suspension": (suspension_plant(states), _NMEAS, _NCON)}, change)

    def sized_theirs(states: int, plants: dict[str, Any], change: float) -> dict[str, Any]:
        return theirs(1, {"suspension": (suspension_plant(states), _NMEAS, _NCON)}, change)

    def norms(plants: dict[str, Any], gains: dict[str, Any]) -> Array:
        return np.array([hinf_norm(lft(P, gains[name])).upper_bound for name, (P, *_) in plants.items()])

    call = "bc.tune(P, ny, nu, bc.tunable.gain(), n_starts={})"
    return Scene(
        title="Norm-optimal static gain, alternating two plants",
        question="From two published plants (COMPleib 1.1, HE1 and REA2) to a gain for each.",
        measure=f"Norm of the loop over the least that twenty starts find, less one, the larger; at least {ROOT:.0e}.",
        problem=published_plants,
        reference=lambda plants: norms(plants, ours(_STARTS, plants, 0.0, seed=1)),
        error=lambda plants, best, gains: max(float((norms(plants, gains) / best).max()) - 1.0, ROOT),
        methods=(
            *settings("tune", "{} starts", (1, 2, 5, 10), ours, **_OURS, call=call),
            *settings("linfnorm, Nelder-Mead", "{} starts", (1, 2, 5, 10), theirs, modules=("slycot",)),
            *sized(
                settings("tune", "{} states", _STATES, sized_ours, **_OURS),
                settings("linfnorm, Nelder-Mead", "{} states", _STATES, sized_theirs, modules=("slycot",)),
            ),
        ),
    )


def sb10ad(
    P: control.StateSpace, nmeas: int, ncon: int, job: int, level: float, gtol: float = 0.0
) -> control.StateSpace:
    """Return slycot's controller: job 1 bisects from a level, job 4 takes the level."""
    import slycot

    matrices = (np.array(part, dtype=float, order="F") for part in (P.A, P.B, P.C, P.D))
    result = slycot.sb10ad(P.nstates, P.ninputs, P.noutputs, ncon, nmeas, level, *matrices, job, gtol, 0.0)
    return control.ss(*result[1:5])


def simplex_gain(P: control.StateSpace, nmeas: int, ncon: int, n_starts: int) -> Array:
    """Return the best gain of some starts of Nelder and Mead's search for the least norm of the loop, by ``linfnorm``.

    Where the loop is unstable, the search lowers the real part of its poles, which counts as large.
    """

    def value(entries: Array) -> float:
        loop = P.lft(control.ss([], [], [], entries.reshape(ncon, nmeas)), ncon, nmeas)
        abscissa = float(loop.poles().real.max())
        return 1e3 * (1.0 + abscissa) if abscissa >= 0.0 else float(control.linfnorm(loop)[0])

    rng, result = np.random.default_rng(0), []
    options: dict[str, Any] = {"method": "Nelder-Mead", "bounds": [(-_MOST_GAIN, _MOST_GAIN)] * (ncon * nmeas)}
    for _ in range(n_starts):
        result.append(minimize(value, rng.standard_normal(ncon * nmeas), **options))
    return min(result, key=lambda run: run.fun).x.reshape(ncon, nmeas)
