"""Plants of published collections through the public functions: certified and checked apart, refused, or uncertified.

CAREX (Benner, Laub & Mehrmann 1995) comes with ``ctrlsys``, without the examples that need data files of their own.
The plants of ``controlgym`` (mostly of COMPleib) are read without importing it, as that would bring torch:
``pip install --no-deps controlgym``; without it they are skipped.
"""

import importlib.util
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import control
import numpy as np
import pytest
from flint import fmpq_mat
from scipy import io

import boomctl as bc
from boomctl.exceptions import ReductionError, SynthesisError
from tests.exact import Exact, dyadic
from tests.fuzz import in_time
from tests.profiles import is_hunt
from tests.references import gains
from tests.test_oracle import h2_outcome, hinf_outcome

ctrlsys = pytest.importorskip("ctrlsys", reason="its collections come with the extra dev")
pytestmark = pytest.mark.slow

LIMIT = 20  # s of processor time for one call; the synthesis gets a time limit of its own below it
LARGE_FROM = 100  # states from which on a call may take longer: it is of as many loops as there are states
LARGE_LIMIT = 150  # [s]
SYNTHESIS_LIMIT = 12.0  # s
# states beyond which a plant is not asked for a synthesis, whose closed loop has twice as many
SYNTHESIZED = 130
LOOPS = 60  # states up to which margins are asked for: of a loop each, and of all together
EXACT = 30  # states up to which answers are checked exactly
RESIDUAL = 1e-6  # relative, of a Riccati equation, in exact arithmetic: what the documentation promises
SHOWN = 1e-5  # share by which a response may exceed what is certified as its largest: that of a certificate
SLACK = 1e-9  # relative, of bounds against exact values
CAREX = [(1, 1), (1, 2), *((2, k) for k in range(1, 9)), (3, 1), (3, 2), (4, 1), (4, 2), (4, 3)]


@dataclass(frozen=True)
class Plant:
    """A plant with controls and measurements, disturbances and performance outputs, and weights."""

    A: np.ndarray
    B1: np.ndarray
    B2: np.ndarray
    C1: np.ndarray
    C2: np.ndarray
    D11: np.ndarray
    D12: np.ndarray
    D21: np.ndarray
    Q: np.ndarray
    R: np.ndarray

    @property
    def control_way(self):
        """From the controls to the measurements."""
        return control.ss(self.A, self.B2, self.C2, 0.0)

    @property
    def generalized(self):
        D = np.block([[self.D11, self.D12], [self.D21, np.zeros((len(self.C2), self.B2.shape[1]))]])
        return control.ss(self.A, np.hstack([self.B1, self.B2]), np.vstack([self.C1, self.C2]), D)


def weighed(A, B, C, Q, R):
    """Return the plant of a regulator problem: noise at the controls and measurements, states and controls weighed."""
    n, m, p = len(A), B.shape[1], len(C)
    values, U = np.linalg.eigh(0.5 * (Q + Q.T))
    C1 = np.vstack([np.sqrt(np.maximum(values, 0.0))[:, None] * U.T, np.zeros((m, n))])
    D12 = np.vstack([np.zeros((n, m)), np.linalg.cholesky(0.5 * (R + R.T)).T])
    B1, D21 = np.hstack([B, np.zeros((n, p))]), np.hstack([np.zeros((p, m)), np.eye(p)])
    return Plant(A=A, B1=B1, B2=B, C1=C1, C2=C, D11=np.zeros((n + m, m + p)), D12=D12, D21=D21, Q=Q, R=R)


def carex(group, number):
    def asked(flags):
        return ctrlsys.bb01ad("D", np.array([group, number], np.int32), np.zeros(7), np.zeros(4, np.int32), flags)

    _, n, m, p, a, b, c, r, *_ = asked(np.array([0, 1, 1, 0, 1, 1], bool))  # factors B, R and C
    q = asked(np.array([0, 1, 1, 1, 1, 1], bool))[8]
    return weighed(a[:n, :n], b[:n, :m], c[:p, :n], q[:n, :n], r[:m, :m])


def gym_folder():
    found = importlib.util.find_spec("controlgym")
    return Path(found.origin).parent / "envs" / "linear_control_src" if found and found.origin else None


def gym_names():
    folder = gym_folder()
    return sorted(path.stem for path in folder.glob("*.mat")) if folder else []


def gym(name):
    d = {
        key: np.asarray(value, float) for key, value in io.loadmat(gym_folder() / f"{name}.mat").items() if key in KEYS
    }
    Q, R = d["C1"].T @ d["C1"], d["D12"].T @ d["D12"]
    return Plant(C2=d.pop("C"), Q=Q, R=R, **d)


KEYS = ("A", "B1", "B2", "C", "C1", "D11", "D12", "D21")
MAKERS = {"carex": carex, "gym": gym}
CASES = [("carex", case) for case in CAREX] + [("gym", (name,)) for name in gym_names()]


def two_signals(system):
    """Return the part of a system of two inputs at most, which the exact norm knows."""
    return control.ss(system.A, system.B[:, :2], system.C, system.D[:, :2])


def largest_seen(system):
    """Return the largest singular value of a response at and beside its resonances: below the norm."""
    poles = system.poles()
    around = np.abs(poles.imag) + np.array([-1.0, -0.5, 0.0, 0.5, 1.0])[:, None] * np.abs(poles.real)
    omega = np.unique(np.concatenate([[0.0], around[around > 0.0], np.geomspace(1e-3, 1e4, 50)]))
    return gains(system, omega).max()


def rationals(matrix):
    return fmpq_mat([[dyadic(x) for x in row] for row in np.asarray(matrix, float).tolist()])


def riccati_residual(plant, X):
    """Return the residual of ``A^T X + X A - X B R^-1 B^T X + Q`` over its largest term, summed exactly."""
    A, B, Q, R, Y = (rationals(M) for M in (plant.A, plant.B2, plant.Q, plant.R, X))
    XB = Y * B
    terms = [Y * A, XB * R.inv() * XB.transpose(), Q]
    left = terms[0] + terms[0].transpose() - terms[1] + Q
    size = [sum(float(x.p) / float(x.q) * float(x.p) / float(x.q) for x in M.entries()) ** 0.5 for M in [left, *terms]]
    return size[0] / max(size[1:])


def regulator(plant):
    found = bc.lqr(plant.control_way, plant.Q, plant.R)
    assert np.linalg.eigvals(plant.A - plant.B2 @ found.gain).real.max() < 0.0
    if len(plant.A) <= EXACT:
        assert riccati_residual(plant, found.riccati_solution) <= RESIDUAL
    return "certified"


def least_h2(plant):
    found = bc.h2(plant.generalized, len(plant.C2), plant.B2.shape[1])
    assert found.closed_loop.poles().real.max() < 0.0
    if found.closed_loop.nstates <= EXACT:
        assert Exact.of(found.closed_loop).h2() == pytest.approx(found.norm, rel=1e-4)
    return "certified"


def least_hinf(plant):
    found = bc.h_infinity(plant.generalized, len(plant.C2), plant.B2.shape[1], time_limit=SYNTHESIS_LIMIT)
    assert found.closed_loop.poles().real.max() < 0.0
    assert largest_seen(found.closed_loop) <= found.gamma * (1.0 + SHOWN)
    return "certified" if found.certificate.norm_bounds.certified else "uncertified"


def checked(norm, outcome, system):
    """Return how a norm is told, exactly checked where that does not take long."""
    if system.nstates <= EXACT:
        return outcome(0, system, Exact.of(system))
    return "certified" if norm(system).certified else "uncertified"


def norm_h2(plant):
    return checked(bc.h2_norm, h2_outcome, plant.control_way)


def norm_hinf(plant):
    return checked(bc.hinf_norm, hinf_outcome, two_signals(plant.control_way))


def half(plant):
    system = two_signals(plant.control_way)
    found = bc.reduce(system, max(system.nstates // 2, 1))
    if len(plant.A) <= EXACT and not found.retained_order:
        assert (Exact.of(system) - Exact.of(found.system)).norm()[0] <= found.error_norm * (
            1.0 + SLACK
        ) + sys.float_info.min
    return "certified"


def loop_margins(plant):
    """Of the regulator's loop: Kalman's inequality promises 60 degrees and a gain from one half on where R is diagonal."""
    gain = bc.lqr(plant.control_way, plant.Q, plant.R).gain
    states = [f"state{i}" for i in range(len(plant.A))]
    controls = [f"control{i}" for i in range(plant.B2.shape[1])]
    P = control.ss(plant.A, plant.B2, np.eye(len(plant.A)), 0.0, inputs=controls, outputs=states)
    found = bc.margins(P, control.ss([], [], [], -gain, inputs=states, outputs=controls))
    diagonal = np.array_equal(plant.R, np.diag(np.diag(plant.R)))
    for name in controls if diagonal else ():
        loop = found[name]
        assert loop.phase_margin_deg >= 60.0 - 1e-2
        assert loop.gain_margin[0] <= 0.5 + 1e-4
        assert loop.gain_margin[1] > 1e3
    return "certified" if found.multiloop_input.certified else "uncertified"


FUNCTIONS = {
    "lqr": regulator,
    "h2": least_h2,
    "h_infinity": least_hinf,
    "reduce": half,
    "hinf_norm": norm_hinf,
    "h2_norm": norm_h2,
    "margins": loop_margins,
}
LARGE = ("reduce", "hinf_norm", "h2_norm", "lqr")  # of plants too large for a synthesis
REFUSALS = (SynthesisError, ReductionError, ValueError)


def outcome(function, plant):
    """Return how a call ended; a refusal names a reason in one line."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            return FUNCTIONS[function](plant)
        except REFUSALS as refusal:
            if isinstance(refusal, np.linalg.LinAlgError) or " " not in str(refusal):
                raise
            return "refused"


def asked_of(plant):
    """Return the names of the functions that a plant is handed to."""
    names = FUNCTIONS if len(plant.A) <= SYNTHESIZED else LARGE
    return [name for name in names if name != "margins" or len(plant.A) <= LOOPS]


TRIED = CASES if is_hunt() else CASES[::2]  # every second in the full profile, a choice


@pytest.mark.parametrize(("name", "case"), TRIED, ids=[f"{name}-{'.'.join(map(str, case))}" for name, case in TRIED])
def test_published_plant_is_certified_or_refused_in_time(name, case):
    plant = MAKERS[name](*case)
    for function in asked_of(plant):
        with in_time(LARGE_LIMIT if len(plant.A) >= LARGE_FROM else LIMIT):
            assert outcome(function, plant) in ("certified", "uncertified", "refused"), function
