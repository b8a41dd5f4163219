"""Plants, controllers and loops written out step by step, for comparison."""

import control as ct
import numpy as np
from scipy import linalg

from boomctl.lti.system import Lti
from boomctl.simulation.conditioning import conditioning_gains

__all__ = ["conditioning_gain", "mass_on_spring", "random_controller", "random_plant", "stepped_loop"]


def conditioning_gain(A, B, C, D, softening=0.1):
    """Return the gain of one controller whose controls all have limits."""
    inputs, outputs = (tuple(f"{letter}{i}" for i in range(n)) for letter, n in (("y", B.shape[1]), ("u", len(C))))
    return conditioning_gains((Lti(A, B, C, D, inputs, outputs),), np.ones(len(C), dtype=bool), softening)[0][0]


def mass_on_spring(mass=1.0, stiffness=100.0, damping=0.0):
    """Return a mass on a spring, input force ``f``, outputs ``x`` and ``v``."""
    A = [[0.0, 1.0], [-stiffness / mass, -damping / mass]]
    return ct.ss(A, [[0.0], [1.0 / mass]], np.eye(2), 0.0, inputs=["f"], outputs=["x", "v"])


def random_plant(rng, n=5, controls=2, measurements=2):
    """Return a stable plant, inputs ``w``, ``u0``..., outputs ``y0``..., ``z``; only ``w`` is felt at once."""
    A = rng.standard_normal((n, n))
    A -= (np.abs(np.linalg.eigvals(A).real).max() + 0.3) * np.eye(n)
    B, C = rng.standard_normal((n, controls + 1)), rng.standard_normal((measurements + 1, n))
    D = np.zeros((measurements + 1, controls + 1))
    D[:, 0] = rng.standard_normal(measurements + 1)
    inputs, outputs = ["w", *(f"u{k}" for k in range(controls))], [*(f"y{k}" for k in range(measurements)), "z"]
    return ct.ss(A, B, C, D, inputs=inputs, outputs=outputs)


def random_controller(rng, dt, n=2, controls=2, measurements=2, gain=0.4):
    """Return a stable discrete controller."""
    A = rng.standard_normal((n, n))
    A *= 0.8 / max(np.abs(np.linalg.eigvals(A)).max(), 1e-6)
    B, C = rng.standard_normal((n, measurements)), gain * rng.standard_normal((controls, n))
    D = gain * rng.standard_normal((controls, measurements))
    labels = {"inputs": [f"y{k}" for k in range(measurements)], "outputs": [f"u{k}" for k in range(controls)]}
    return ct.ss(A, B, C, D, dt, **labels)


def stepped_loop(plant, law, w, h, limit=np.inf, rate=np.inf, delay=0.0):
    """Step a loop in the plant's own coordinates; anything that is held or ramps goes through one matrix exponential.

    Returns outputs and controls given, (signals, samples); the controller is not corrected where it saturates.
    """
    n, nu = plant.nstates, law.noutputs

    def flow(duration, x, u, first, slope):
        big = np.zeros((n + 2, n + 2))
        big[:n, :n], big[:n, n] = plant.A, plant.B[:, 0] * first + plant.B[:, 1:] @ u
        big[:n, n + 1] = plant.B[:, 0] * slope
        big[n + 1, n + 1], big[n, n] = 0.0, 0.0
        start = np.concatenate([x, [1.0, 0.0]])
        big[n + 1, n] = 1.0
        return (linalg.expm(big * duration) @ start)[:n]

    x, state, last = np.zeros(n), np.zeros(law.nstates), np.zeros(nu)
    lag, rest = int(np.floor(delay / h + 1e-9)), 0.0
    rest = delay - lag * h
    given, outputs = [], []
    for k in range(len(w)):
        y = plant.C @ x + plant.D[:, 0] * w[k]
        outputs.append(y)
        if k == len(w) - 1:
            break
        heard = y[: law.ninputs]
        asked = law.C @ state + law.D @ heard
        last = np.clip(np.clip(asked, -limit, limit), last - rate * h, last + rate * h)
        state = law.A @ state + law.B @ heard
        given.append(last)
        slope = (w[k + 1] - w[k]) / h
        old = given[k - lag - 1] if k - lag - 1 >= 0 else np.zeros(nu)
        new = given[k - lag] if k - lag >= 0 else np.zeros(nu)
        if rest > 1e-12:
            x = flow(rest, x, old, w[k], slope)
        x = flow(h - rest, x, new, w[k] + slope * rest, slope)
    return np.array(outputs).T, np.array(given).T
