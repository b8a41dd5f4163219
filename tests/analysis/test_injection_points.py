"""Injection points of loops over boxes: worst cases against responses by hand at many points and frequencies."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import boomctl as bc
from boomctl.structure import AffineFamily, SecondOrderModel

GRID = np.geomspace(1e-3, 1e5, 600)  # continuous: [rad/s]; sampled: tangents of half the angle on the unit circle


class Case:
    """A family of three masses between walls, with one or two inputs, and a damper or filter as its controller."""

    def __init__(self, seed, width=None):
        rng = self.rng = np.random.default_rng(seed)
        self.springs, self.masses = rng.uniform(1.0, 9.0, 4), rng.uniform(0.5, 2.0, 3)
        self.dampers, self.size = rng.uniform(0.05, 0.3, 4), int(rng.integers(1, 4))
        self.varied = rng.permutation(11)[: self.size]
        spread = rng.uniform(0.05, 0.25, self.size) if width is None else np.full(self.size, width)
        forces = {"push": [1.0, 0.0, 0.0], "u": [0.0, 1.0, 0.0]}
        self.forces = forces if rng.integers(2) else {"u": forces["u"]}
        self.outputs = {"y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
        ranges = {f"p{k}": (1.0 - s, 1.0 + s) for k, s in enumerate(spread)}
        self.family = AffineFamily.through(
            ranges, lambda p: SecondOrderModel(*self.matrices([*p.values()]), self.forces, self.outputs)
        )
        corner, gain = rng.uniform(5.0, 20.0), rng.uniform(0.05, 0.4)
        self.K = control.ss(-corner, corner, corner * gain, -corner * gain, inputs="y", outputs="u")
        self.delay = 0.0
        self.points = [str(x) for x in rng.permutation(["u", "y"])[: rng.integers(1, 3)]]
        inputs = [f"{x}_injected" for x in self.points] + ["push"] * (len(self.forces) - 1)
        self.driven = [str(x) for x in rng.permutation(inputs)[: rng.integers(1, len(inputs) + 1)]]
        if "y_injected" not in self.driven and "u_injected" not in self.driven:
            self.driven.append(f"{self.points[0]}_injected")
        self.judged = [str(x) for x in rng.permutation(["y", "z", "u"])[: rng.integers(1, 4)]]

    def sampled(self):
        dt = self.rng.uniform(0.02, 0.2)
        self.K = control.sample_system(self.K, dt, "tustin", copy_names=True)
        self.delay = float(self.rng.choice([0.0, self.rng.uniform(0.0, 1.0), 1.0, self.rng.uniform(1.0, 2.0)]) * dt)
        return self

    def matrices(self, factors):
        values = np.concatenate([self.springs, self.masses, self.dampers])
        values[self.varied] *= factors
        k, m, c = values[:4], values[4:7], values[7:]
        C, K = (np.diag(x[:-1] + x[1:]) - np.diag(x[1:-1], 1) - np.diag(x[1:-1], -1) for x in (c, k))
        return np.diag(m), C, K

    def plant(self, factors, at):
        """Return the responses of the plant from all its inputs at points of the complex plane, by hand."""
        M, C, K = self.matrices(factors)
        B, L = np.array([*self.forces.values()]).T, np.array([*self.outputs.values()])
        if self.K.isctime():
            s = at[:, None, None]
            return L @ np.linalg.solve(s**2 * M + s * C + K, B + 0.0 * s)
        m, dt, late = B.shape[1], self.K.dt, self.delay
        A = np.block([[np.zeros((3, 3)), np.eye(3)], [np.linalg.solve(M, -K), np.linalg.solve(M, -C)]])
        wide = np.block([[A, np.vstack([np.zeros((3, m)), np.linalg.solve(M, B)])], [np.zeros((m, 6 + m))]])
        whole = int(late / dt + 1e-9)
        step, rest = (
            expm(wide * dt),
            expm(wide * (dt - (late - whole * dt))),
        )  # rest: from a change of u to the next sample
        entering = np.repeat(step[None, :6, 6:] + 0j, len(at), axis=0)
        new, z = rest[:6, -1], at[:, None]
        entering[:, :, -1] = (new * z + step[:6, -1] - new) / z ** (whole + 1)
        return np.pad(L, ((0, 0), (0, 3))) @ np.linalg.solve(z[:, :, None] * np.eye(6) - step[:6, :6], entering)

    def responses(self, factors, at):
        """Return the responses of the loop at points of the complex plane."""
        G, K = self.plant(factors, at), np.atleast_1d(self.K(at)).reshape(-1, 1, 1)
        S = 1.0 / (1.0 - K * G[:, :1, -1:])
        sent = {"u_injected": S, "y_injected": K * S, "push": K * G[:, :1, :1] * S}
        own = {"push": G[:, :, :1]}
        columns = [np.hstack([own.get(name, 0.0) + G[:, :, -1:] * sent[name], sent[name]]) for name in self.driven]
        return np.dstack(columns)[:, [["y", "z", "u"].index(name) for name in self.judged]]

    def gain(self, factors):
        """Return the largest singular value of the loop over all frequencies, on finer and finer grids."""
        grid, values = GRID, np.zeros(1)
        for _ in range(4):
            at = 1j * grid if self.K.isctime() else (1.0 + 1j * grid) / (1.0 - 1j * grid)
            values = np.linalg.svd(self.responses(factors, at), compute_uv=False)[:, 0]
            top = int(np.clip(values.argmax(), 1, len(grid) - 2))
            grid = np.geomspace(grid[top - 1], grid[top + 1], 30)
        return float(values.max())

    def rms(self, factors):
        """Return the H2 norm by quadrature over frequency."""
        if self.K.isctime():
            grid = np.geomspace(1e-5, 1e6, 4_000)
            squares = (np.abs(self.responses(factors, 1j * grid)) ** 2).sum(axis=(1, 2)) * grid / np.pi
            return float(np.sqrt(np.trapezoid(squares, np.log(grid))))
        circle = np.exp(1j * np.pi * (np.arange(4_000) + 0.5) / 4_000)
        return float(np.sqrt((np.abs(self.responses(factors, circle)) ** 2).sum(axis=(1, 2)).mean()))

    def worst(self, **options):
        return bc.worst_case(
            self.family, self.K, self.driven, self.judged, delay=self.delay, injection_points=self.points, **options
        )

    def loop(self, delta):
        loop = bc.feedback_loop(self.family.at(delta), self.K, self.points, delay=self.delay)
        return bc.synthesis.select_channels(loop, self.driven, self.judged)


def drawn(seed, sampled, **more):
    return Case(seed, **more).sampled() if sampled else Case(seed, **more)


SEEDS = [range(2), pytest.param(range(2, 60), marks=pytest.mark.slow)]


@pytest.mark.slow
@pytest.mark.parametrize("numbers", SEEDS)
def test_worst_case_with_injection_bounds_all_points(numbers):
    """Continuous loops, and at every third seed a sampled one, which takes longer."""
    for case in [*(drawn(n, False) for n in numbers), *(drawn(n, True) for n in numbers if n % 3 == 1)]:
        found = case.worst(tolerance=1e-2)
        assert found.upper_bound < np.inf, found.reason
        here = case.gain([*found.values.values()])
        assert found.norm.lower * (1.0 - 1e-6) <= here <= found.norm.lower * (1.0 + 1e-6)
        points = 1.0 + (case.family.high - 1.0) * case.rng.uniform(-1.0, 1.0, (20, case.size))
        assert max(map(case.gain, points)) <= found.upper_bound <= found.norm.lower * 1.0101


@pytest.mark.parametrize("sampled", [False, True])
def test_worst_h2_norm_with_injection_is_attained(sampled):
    for seed in range(2):
        case = drawn(seed, sampled)
        case.judged = ["y", "z"]
        found = case.worst(norm="h2")
        assert case.rms([*found.values.values()]) == pytest.approx(found.norm.value, rel=1e-4)
        points = 1.0 + (case.family.high - 1.0) * case.rng.uniform(-1.0, 1.0, (4, case.size))
        assert max(map(case.rms, points)) <= found.norm.value * (1.0 + 1e-4)


@pytest.mark.parametrize("sampled", [False, True])
def test_worst_case_of_point_equals_norm_of_loop(sampled):
    for seed in range(3):
        case = drawn(seed, sampled, width=1e-9)
        found, plain = case.worst(tolerance=None), bc.hinf_norm(case.loop(np.zeros(case.size)))
        assert found.norm.value == pytest.approx(plain.value, rel=1e-7)


def test_robust_stability_checks_injection_points_alone():
    case = Case(1)
    assert bc.robust_stability(case.family, case.K, injection_points=["y", "u"]) == bc.robust_stability(
        case.family, case.K
    )
