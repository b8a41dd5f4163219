"""The largest gain of sampled loops between samples: closed forms, finer and finer samples, and disturbances tried."""

from dataclasses import replace
from importlib import import_module

import control
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import linalg

import boomctl as bc
from boomctl.analysis.norm import matrices_norm
from boomctl.lti.system import Lti, lower_lft, of
from tests.profiles import examples

_DT = 0.3
_LATE = (0.0, 0.25, 0.5, 1.0, 1.5)  # samples


def random_loop(seed):
    """Return a random plant, a sampled controller with which it is stable, and a delay."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 5))
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() - rng.uniform(-0.5, 0.3)) * np.eye(n)
    D = [[rng.choice([0.0, 0.2]), rng.standard_normal()], [0.0, rng.choice([0.0, 0.3])]]
    names = {"inputs": ["w", "u"], "outputs": ["z", "y"]}
    plant = control.ss(A, rng.standard_normal((n, 2)), rng.standard_normal((2, n)), D, **names)
    late = rng.choice(_LATE) * _DT
    for _ in range(200):
        A, B, C, D = rng.uniform(-0.9, 0.9), 1.0, rng.standard_normal(), rng.standard_normal()
        K = control.ss([[A]], [[B]], [[C]], [[D]], _DT, inputs="y", outputs="u")
        if np.abs(bc.feedback_loop(plant, K, delay=late).poles()).max() < 0.95:
            return plant, K, late
    assume(False)
    raise AssertionError("no controller was found that stabilizes the plant")


def finer(plant, K, late, count):
    """Return the norm of a loop whose disturbance is held, and whose output is read, so many times a sample."""
    A, B, C, D = (np.asarray(getattr(control.sample_system(plant, _DT / count), letter)) for letter in "ABCD")
    n, lag = len(A), round(late / _DT * count)
    before = -((-1 - lag) // count)  # the control that acts just before a sample, counted backwards
    queue = before if D[1, 1] else -(-lag // count)
    columns = []
    for unit in np.eye(n + queue + count + 1):
        x, held, w, u = unit[:n], unit[n : n + queue], unit[n + queue : -1], unit[-1]
        sent, shown = [u, *held], []
        y = C[1] @ x + D[1, 1] * (sent[before] if D[1, 1] else 0.0)
        for i in range(count):
            acting = sent[-((i - lag) // count)]
            shown.append(C[0] @ x + D[0, 0] * w[i] + D[0, 1] * acting)
            x = A @ x + B[:, 0] * w[i] + B[:, 1] * acting
        columns.append([*x, *sent[:queue], *shown, y])
    M, s = np.array(columns).T, n + queue
    lifted = Lti(M[:s, :s], M[:s, s:], M[s:, :s], M[s:, s:], dt=_DT)
    return matrices_norm(lower_lft(lifted, of(K, "K", sampled=True)).balanced()).lower_bound


@given(st.integers(0, 10**6))
@examples(60)
def test_it_is_where_finer_and_finer_samples_go(seed):
    plant, K, late = random_loop(seed)
    found = bc.analysis.sampled_data_norm(plant, K, outputs="z", delay=late)
    assert found.upper_bound <= found.lower_bound * (1.0 + 1e-4)
    coarse, fine, finest = (finer(plant, K, late, count) for count in (8, 16, 32))
    # the error falls with the length of the finer samples, or its square: either way by at least half
    assert finest == pytest.approx(found.lower_bound, rel=0.15)
    assert abs(finest - found.lower_bound) <= 0.6 * abs(fine - found.lower_bound) + 1e-4 * found.lower_bound
    assert abs(fine - found.lower_bound) <= 0.6 * abs(coarse - found.lower_bound) + 2e-4 * found.lower_bound


@pytest.mark.parametrize("norm", [1e-9, 1.0, 1.0 + 1e-6, 1e9])  # one is the level that is tried first
def test_a_norm_of_any_size_is_verified(norm):
    plant = control.ss(-1.0, [[norm, 1.0]], [[1.0], [1.0]], 0.0, inputs=["w", "u"], outputs=["z", "y"])
    nothing = control.ss([], [], [], [[0.0]], _DT, inputs="y", outputs="u")
    found = bc.analysis.sampled_data_norm(plant, nothing, outputs="z")
    assert found.verified
    assert found.lower_bound * (1.0 - 1e-12) <= norm <= found.upper_bound


@pytest.mark.parametrize(("times", "verified"), [(5.0, True), (20.0, False)])
def test_bounds_of_mode_far_above_sampling_rate(times, verified):
    """Disturbances that are linear in parts of a sample do not reach the peak of a fast mode; a level above it is shown."""
    damping, omega = 1e-2, times * np.pi / _DT
    A, names = omega * np.array([[-damping, 1.0], [-1.0, -damping]]), {"inputs": ["w", "u"], "outputs": ["z", "y"]}
    plant = control.ss(A, [[damping * omega, 0.0], [0.0, 0.0]], np.eye(2), 0.0, **names)
    nothing = control.ss([], [], [], [[0.0]], _DT, inputs="y", outputs="u")
    found = bc.analysis.sampled_data_norm(plant, nothing, outputs="z")
    exact = bc.hinf_norm(bc.synthesis.select_channels(plant, "w", "z")).value
    assert found.verified == verified
    assert found.lower_bound <= exact <= found.upper_bound <= found.lower_bound * (1.0 + 1e-4)


def test_wrong_levels_are_not_verified(monkeypatch):
    plant, K, late = random_loop(5)
    right = bc.analysis.sampled_data_norm(plant, K, outputs="z", delay=late)
    module = import_module("boomctl.analysis.sampled_data_norm")
    step = lambda *of, found=module._step: replace(found(*of), W=1.1 * found(*of).W)  # noqa: E731
    monkeypatch.setattr(module, "_step", step)
    wrong = bc.analysis.sampled_data_norm(plant, K, outputs="z", delay=late)
    assert right.verified
    assert not wrong.verified
    assert wrong.lower_bound == pytest.approx(right.lower_bound, rel=1e-5)


@pytest.mark.slow
@given(st.integers(0, 10**6))
@examples(10)
def test_what_has_no_feedback_has_its_own_norm(seed):
    plant, _, _ = random_loop(seed)
    stable = control.ss(
        plant.A - (np.linalg.eigvals(plant.A).real.max() + 0.5) * np.eye(plant.nstates),
        plant.B,
        plant.C,
        [[0.3, 0.0], [0.0, 0.0]],
        inputs=["w", "u"],
        outputs=["z", "y"],
    )
    nothing = control.ss([], [], [], [[0.0]], _DT, inputs="y", outputs="u")
    found = bc.analysis.sampled_data_norm(stable, nothing)
    exact = bc.hinf_norm(bc.synthesis.select_channels(stable, "w"))
    assert found.lower_bound == pytest.approx(exact.lower_bound, rel=1e-5)
    assert found.upper_bound == pytest.approx(exact.upper_bound, rel=1e-5)


def test_stiff_filters_and_many_parts_of_a_sample_do_no_harm():
    """A filter 1e6 times faster than the samples: nothing that grows is computed."""
    A = np.diag([-1.0, -1e6])
    names = {"inputs": ["w", "u"], "outputs": ["z", "y"]}
    plant = control.ss(A, [[1.0, 1.0], [1e6, 0.0]], [[1.0, 0.0], [1.0, 0.0]], 0.0, **names)
    slow = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0], [1.0]], 0.0, **names)
    K = control.ss([], [], [], [[-0.5]], 1.0, inputs="y", outputs="u")
    assert bc.analysis.sampled_data_norm(plant, K).lower_bound == pytest.approx(
        bc.analysis.sampled_data_norm(slow, K).lower_bound, rel=1e-6
    )


def test_a_level_is_that_of_a_gain_in_closed_form():
    """``x' = w`` read and reset at each sample by a deadbeat control: ``z = x`` has the norm of one sample's operator.

    With ``u = -x/h`` held the state is ``x(kh + t) = x_k (1 - t/h) + int w``, and ``x_{k+1}`` is what ``w`` brought alone:
    the norm is the largest over the angles, here compared with a quadrature of the operator.
    """
    plant = control.ss([[0.0]], [[1.0, 1.0]], [[1.0]], 0.0, inputs=["w", "u"], outputs="x")
    K = control.ss([], [], [], [[-1.0]], 1.0, inputs="x", outputs="u")
    count = 150
    middle = (np.arange(count) + 0.5) / count
    volterra = (np.tril(np.ones((count, count)), -1) + 0.5 * np.eye(count)) / count
    decay = np.outer(1.0 - middle, np.ones(count)) / count
    best = max(linalg.svdvals(volterra + np.exp(-1j * angle) * decay)[0] for angle in np.linspace(0.0, np.pi, 7))
    assert bc.analysis.sampled_data_norm(plant, K).lower_bound == pytest.approx(best, rel=1e-3)


def test_controls_may_count_and_wrong_loops_are_refused():
    plant, K, late = random_loop(5)
    both = bc.analysis.sampled_data_norm(plant, K, outputs=["z", "u"], delay=late).lower_bound
    each = [bc.analysis.sampled_data_norm(plant, K, outputs=name, delay=late).lower_bound for name in ("z", "u")]
    assert max(each) * (1.0 - 1e-6) <= both <= np.hypot(*each) * (1.0 + 1e-6)
    unstable = control.ss([], [], [], [[50.0]], _DT, inputs="y", outputs="u")
    assert bc.analysis.sampled_data_norm(plant, unstable).lower_bound == np.inf
    direct = control.ss(-1.0, [[1.0, 1.0]], [[1.0]], [[1.0, 0.0]], inputs=["w", "u"], outputs="y")
    with pytest.raises(ValueError, match="disturbance 'w' acts on measurement 'y' directly: samples of it") as refused:
        bc.analysis.sampled_data_norm(direct, K)
    said = {"P": direct, "boomctl": bc, "control": control}
    exec(str(refused.value).partition("before it: ")[2], said)  # what the message says to write
    weak = control.ss([], [], [], [[-0.1]], _DT, inputs="y", outputs="u")
    assert bc.analysis.sampled_data_norm(said["P"], weak, "filtered").verified


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from(_LATE))
@examples(20)
def test_sample_plant_matches_sampled_loop(seed, late):
    plant, K, _ = random_loop(seed)
    seen = bc.analysis.sample_plant(plant, _DT, "u", delay=late * _DT)
    loop, same = bc.feedback_loop(plant, K, delay=late * _DT), bc.feedback_loop(seen, K)
    assert np.sort_complex(loop.poles()) == pytest.approx(np.sort_complex(same.poles()), abs=1e-9)
    assert bc.hinf_norm(loop).lower_bound == pytest.approx(bc.hinf_norm(same).lower_bound, rel=1e-9)
    assert seen.output_labels == plant.output_labels
