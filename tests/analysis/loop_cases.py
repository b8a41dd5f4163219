"""Structures with controllers that do something to them, and sampled loops stepped event by event, for the tests of loops."""

from itertools import pairwise

import control
import numpy as np
from scipy import linalg
from scipy.linalg import expm

from boomctl.structure import AffineFamily, SecondOrderModel

_NEAR = 1e-9  # share of a sample within which a change of control at a time has not yet happened when it is read
SIGNALS = {"inputs": ["y0", "y1"], "outputs": ["u0", "u1"]}


def chain(seed, n=4, damping=0.01):
    """Return a lightly damped chain of masses with two collocated pairs, ``u`` and ``y``, and a disturbance."""
    rng = np.random.default_rng(seed)
    M = np.diag(rng.uniform(0.5, 2.0, n))
    K = between_walls(rng.uniform(1.0, 5.0, n + 1))
    eye = np.eye(n)
    return SecondOrderModel(
        M, damping * K, K, {"u0": eye[0], "w": eye[n // 2], "u1": eye[-1]}, {"y0": eye[0], "z": eye[1], "y1": eye[-1]}
    )


def between_walls(k):
    return np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)


def velocity_feedback(gain, corner=30.0):
    """Return ``u = -gain s/(1 + s/corner) y``, or its destabilizing opposite for a negative gain."""
    eye = np.eye(2)
    return control.ss(-corner * eye, eye, gain * corner**2 * eye, -gain * corner * eye, **SIGNALS)


def sampled(K, dt):
    return control.sample_system(K, dt, "tustin", copy_names=True)


class Walls:
    """A family of masses between walls, a damper as its controller, and responses of their loops by hand.

    The first mass is pushed, the controller acts on the second and reads it; some springs, masses and dampers are uncertain.
    """

    def __init__(self, rng, parameters, count=3, spread=(0.05, 0.3), damping=(0.02, 0.2)):
        self.rng, self.size, self.count = rng, parameters, count
        self.springs, self.masses = rng.uniform(1.0, 9.0, count + 1), rng.uniform(0.5, 2.0, count)
        self.dampers, self.varied = rng.uniform(*damping, count + 1), rng.permutation(3 * count + 2)[:parameters]
        eye = np.eye(count)
        self.forces, self.outputs = {"push": eye[0], "u": eye[1]}, {"y": eye[1], "z": eye[-1]}
        ranges = {f"p{k}": (1.0 - s, 1.0 + s) for k, s in enumerate(rng.uniform(*spread, parameters))}
        self.family = AffineFamily.from_function(
            ranges, lambda p: SecondOrderModel(*self.matrices([*p.values()]), self.forces, self.outputs)
        )
        corner, gain = rng.uniform(5.0, 20.0), rng.uniform(0.05, 0.4)
        self.K = control.ss(-corner, corner, corner * gain, -corner * gain, inputs="y", outputs="u")
        self.delay = 0.0

    def sampled(self):
        """Return the same with its controller as it runs in a computer, up to two samples late."""
        dt = self.rng.uniform(0.02, 0.2)
        self.K = sampled(self.K, dt)
        self.delay = float(self.rng.choice([0.0, self.rng.uniform(0.0, 1.0), 1.0, self.rng.uniform(1.0, 2.0)]) * dt)
        return self

    def matrices(self, factors):
        values = np.concatenate([self.springs, self.masses, self.dampers])
        values[self.varied] *= factors
        k, m, c = np.split(values, [self.count + 1, 2 * self.count + 1])
        return np.diag(m), between_walls(c), between_walls(k)

    def plant(self, factors, at):
        """Return the responses of the plant from all its inputs at points of the complex plane."""
        M, C, K = self.matrices(factors)
        B, L = np.array([*self.forces.values()]).T, np.array([*self.outputs.values()])
        if self.K.isctime():
            s = at[:, None, None]
            return L @ np.linalg.solve(s**2 * M + s * C + K, B + 0.0 * s)
        m, n, dt, late = B.shape[1], 2 * self.count, self.K.dt, self.delay
        zero, eye = np.zeros_like(M), np.eye(self.count)
        A = np.block([[zero, eye], [np.linalg.solve(M, -K), np.linalg.solve(M, -C)]])
        wide = np.block([[A, np.vstack([0.0 * B, np.linalg.solve(M, B)])], [np.zeros((m, n + m))]])
        whole = int(late / dt + 1e-9)
        step, rest = expm(wide * dt), expm(wide * (dt - (late - whole * dt)))  # rest: after the control changed
        entering = np.repeat(step[None, :n, n:] + 0j, len(at), axis=0)
        new, z = rest[:n, -1], at[:, None]
        entering[:, :, -1] = (new * z + step[:n, -1] - new) / z ** (whole + 1)
        return np.hstack([L, 0.0 * L]) @ np.linalg.solve(z[:, :, None] * np.eye(n) - step[:n, :n], entering)

    def responses(self, factors, at, driven, judged):
        """Return the responses of the loop at points of the complex plane, also from injected signals."""
        G, K = self.plant(factors, at), np.atleast_1d(self.K(at)).reshape(-1, 1, 1)
        S = 1.0 / (1.0 - K * G[:, :1, -1:])
        sent = {"u_injected": S, "y_injected": K * S, "push": K * G[:, :1, :1] * S}
        own = {"push": G[:, :, :1]}
        columns = [np.hstack([own.get(name, 0.0) + G[:, :, -1:] * sent[name], sent[name]]) for name in driven]
        return np.dstack(columns)[:, [["y", "z", "u"].index(name) for name in judged]]


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
