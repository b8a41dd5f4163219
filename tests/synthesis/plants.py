"""Plants that several tests of synthesis share."""

import control
import numpy as np
from numpy.testing import assert_allclose
from scipy import linalg

import boomctl as bc


def lower_loop_norm(P: control.StateSpace, K: control.StateSpace) -> float:
    """Return the H-infinity norm of ``lft(P, K)`` by python-control and SLICOT alone; infinite if it is not stable."""
    import slycot

    loop = P.lft(K)
    if loop.nstates == 0:
        return float(np.linalg.norm(loop.D, 2))
    if loop.poles().real.max() >= 0.0:
        return float("inf")
    sizes = (loop.nstates, loop.ninputs, loop.noutputs)
    A, B, C, D = loop.A, loop.B, loop.C, loop.D
    return float(slycot.ab13dd("C", "I", "S", "D", *sizes, A, np.eye(loop.nstates), B, C, D)[0])


def assert_verified(P: control.StateSpace, K: control.StateSpace, gamma: float, omega: float) -> None:
    """A norm is attained at its frequency, and neither SLICOT nor a grid about each pole finds a larger one."""
    poles = P.lft(K).poles()
    least = 1e-4 * np.abs(poles).min(initial=1.0)  # beside zero, where a plant may integrate
    assert_allclose(np.linalg.norm(_closed_at(P, K, max(omega, least)), 2), gamma, rtol=1e-5, atol=1e-12)
    assert lower_loop_norm(P, K) <= gamma * (1.0 + 1e-4) + 1e-12
    for pole in poles:
        for offset in (-1.0, 0.0, 1.0):
            near = max(abs(abs(pole.imag) + offset * abs(pole.real)), least)
            assert np.linalg.norm(_closed_at(P, K, near), 2) <= gamma * (1.0 + 1e-5) + 1e-12


def _closed_at(P: control.StateSpace, K: control.StateSpace, omega: float) -> np.ndarray:
    """Return the closed loop at one frequency, from plant and controller at that frequency."""
    if np.isfinite(omega):
        p, k = np.atleast_2d(P(1j * omega)), np.atleast_2d(K(1j * omega))
    else:
        p, k = P.D, K.D
    rows, columns = len(p) - K.ninputs, p.shape[1] - K.noutputs
    inner = np.linalg.solve(np.eye(len(k)) - k @ p[rows:, columns:], k @ p[rows:, :columns])
    return p[:rows, :columns] + p[:rows, columns:] @ inner


def random_plant(seed: int, states: int, sizes: tuple[int, int, int, int], feedthrough: bool) -> control.StateSpace:
    """Return a generalized plant, often unstable; sizes: disturbances and performance signals beyond the others,
    controls, measurements."""
    rng = np.random.default_rng(seed)
    more_w, more_z, ncon, nmeas = sizes
    m, p = nmeas + more_w, ncon + more_z
    A = rng.normal(size=(states, states))
    D = rng.normal(size=(p + nmeas, m + ncon))
    if not feedthrough:
        D[:p, :m], D[p:, m:] = 0.0, 0.0
    return control.ss(A, rng.normal(size=(states, m + ncon)), rng.normal(size=(p + nmeas, states)), D)


def resonators(modes: int, damping: float, seed: int) -> control.StateSpace:
    """Return modes spread over three decades, a disturbance and a force, a motion and its measurement."""
    rng = np.random.default_rng(seed)
    omega = np.geomspace(1.0, 1e3, modes)
    A = linalg.block_diag(*([[0.0, 1.0], [-(w**2), -2.0 * damping * w]] for w in omega))
    B, C = np.zeros((2 * modes, 2)), np.zeros((2, 2 * modes))
    B[1::2], C[:, ::2] = rng.normal(size=(modes, 2)), rng.normal(size=(2, modes))
    return control.ss(A, B, C, 0.0, inputs=["d", "u"], outputs=["q", "y"])


def two_modes(drives: tuple[int, int, int, int], shown: tuple[int, int, int, int]) -> control.StateSpace:
    """Return undamped modes at 2 and 3 rad/s: which of them "d" and "u" drive, which of them "q" and "y" show."""
    A = linalg.block_diag([[0.0, 1.0], [-4.0, 0.0]], [[0.0, 1.0], [-9.0, 0.0]])
    B = np.zeros((4, 2))
    B[1], B[3] = drives[:2], drives[2:]
    C = np.zeros((2, 4))
    C[:, 0], C[:, 2] = shown[::2], shown[1::2]
    names = ["slow", "slow_rate", "fast", "fast_rate"]
    return control.ss(A, B, C, 0.0, inputs=["d", "u"], outputs=["q", "y"], states=names)


def weighed(plant: control.StateSpace) -> control.StateSpace:
    """Return the generalized plant of ``resonators`` and ``two_modes``."""
    return bc.generalized_plant(
        plant,
        disturbances={"d": 1.0},
        noise={"y": 0.1},
        performance={"q": 1.0},
        effort={"u": 0.1},
        measurements="y",
        controls="u",
    )


def yaw_plant(*measured: str, noise=0.01, plant=None, **changes) -> control.StateSpace:
    """Return the boom's antisymmetric half with a cheap control: effort weight 0.01, in SI units.

    ``plant`` stands for another form of that half, ``changes`` for other signals of a kind and their weights.
    """
    signals = {
        "disturbances": {"actuator_anti": 1.0},
        "noise": noise if isinstance(noise, dict) else dict.fromkeys(measured, noise),
        "performance": {"tip_anti": 1.0},
        "effort": {"suspension_anti": 0.01},
    }
    half = bc.split_symmetric(bc.spray_boom())[1] if plant is None else plant
    return bc.generalized_plant(half, **(signals | changes), measurements=measured, controls="suspension_anti")
