"""A sampled loop stepped event by event, sharing nothing with the sampled plant: what acts when is looked up, not derived.

All columns of the step matrix are stepped at once: the state is the plant's, the controller's, the controls sent at the last
samples, and the plant's states at the last samples.
"""

from itertools import pairwise

import numpy as np
from scipy import linalg

_NEAR = 1e-9  # share of a sample within which a change of control at a time has not yet happened when it is read


def step_matrix(plant, controller, delay, *, gain=1.0, of=None, further=0.0, at=None):
    """Return what a loop's state is after one sample, with a signal multiplied by a gain or one delayed further."""
    n, m, p, dt, q = plant.nstates, controller.noutputs, controller.ninputs, controller.dt, controller.nstates
    into = [plant.input_labels.index(name) for name in controller.output_labels]
    out = [plant.output_labels.index(name) for name in controller.input_labels]
    A, B, C, D = plant.A, plant.B[:, into], plant.C[out], plant.D[np.ix_(out, into)]
    gains = {name: gain if name == of else 1.0 for name in (*controller.output_labels, *controller.input_labels)}
    late = np.array([delay + (further if name == at else 0.0) for name in controller.output_labels])
    old = np.array([further if name == at else 0.0 for name in controller.input_labels])
    depth = int(np.ceil((late.max() + old.max()) / dt)) + 2
    size = n + q + depth * (m + n)
    v = np.eye(size, dtype=type(gain))
    x, xk = v[:n], v[n : n + q]
    sent = v[n + q : n + q + depth * m].reshape(depth, m, size)
    past = v[n + q + depth * m :].reshape(depth, n, size)

    def acting(time, new):
        """Return the controls just before a time, counted from this sample."""
        rows = []
        for i in range(m):
            k = int(np.ceil((time - late[i]) / dt - _NEAR)) - 1
            rows.append(new[i] if k == 0 else sent[-k - 1, i])
        return np.array(rows)

    def moved(x, start, end, new):
        times = [j * dt + late[i] for i in range(m) for j in range(-depth - 1, 2)]
        events = [start, *sorted(t for t in times if start + _NEAR * dt < t < end - _NEAR * dt), end]
        for one, other in pairwise(events):
            M = np.zeros((n + m, n + m))
            M[:n, :n], M[:n, n:] = A * (other - one), B * (other - one)
            E = linalg.expm(M)[:n]
            x = E[:, :n] @ x + E[:, n:] @ acting(0.5 * (one + other), new)
        return x

    y = np.zeros((p, size), dtype=type(gain))
    for j, name in enumerate(controller.input_labels):
        age = int(np.ceil(old[j] / dt - _NEAR))
        there = x if age == 0 else moved(past[age - 1], -age * dt, -old[j], None)
        y[j] = gains[name] * (C[j] @ there + D[j] @ acting(-old[j], None))
    asked = controller.C @ xk + controller.D @ y
    u = np.array([gains[name] for name in controller.output_labels])[:, None] * asked
    state = controller.A @ xk + controller.B @ y
    now = moved(x, 0.0, dt, u)
    return np.vstack([now, state, u, sent[:-1].reshape(-1, size), x, past[:-1].reshape(-1, size)])


def radius(plant, controller, delay, **changed):
    """Return the spectral radius of a loop's step."""
    return float(np.abs(np.linalg.eigvals(step_matrix(plant, controller, delay, **changed))).max())
