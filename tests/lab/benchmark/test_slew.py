"""The slew benchmark's peers solve the problem that we solve."""

import numpy as np
import pytest

from boomctl.lab.benchmark.peers.opti import Effort, opti_programme, rockit_torque
from boomctl.lab.benchmark.scene import there
from boomctl.rotating_beam import AssumedModesBeam, HubBeamParameters
from boomctl.slew import optimal_slew

EFFORT = Effort(AssumedModesBeam(HubBeamParameters(), "sfoam", 1), 0.8, 140.0, 2.8, 40)


def planned(effort, substeps, **options):
    """Return the torque that Opti plans."""
    programme = opti_programme(effort, substeps, **options)
    return programme.torque(programme.solve(effort.angle))


@pytest.mark.slow
@pytest.mark.parametrize(
    "peer",
    [
        lambda effort, substeps: planned(effort, substeps).left,
        lambda effort, substeps: planned(effort, substeps, mapped=True).left,
        pytest.param(
            lambda effort, substeps: rockit_torque(effort, substeps).left,
            marks=pytest.mark.skipif(not there("rockit"), reason="rockit is not installed"),
        ),
    ],
)
def test_same_optimum(peer):
    options = {"method": "shooting", "intervals": EFFORT.intervals}
    ours = optimal_slew(EFFORT.beam, EFFORT.angle, EFFORT.torque_limit, "effort", EFFORT.duration, **options).history
    torques, theirs = ours.left, peer(EFFORT, 8)
    assert np.sum(torques**2) == pytest.approx(np.sum(theirs**2), rel=1e-6)
    assert torques == pytest.approx(theirs, abs=1e-3 * EFFORT.torque_limit)
    assert np.abs(torques).max() == pytest.approx(EFFORT.torque_limit, rel=1e-6)  # the limit binds


def test_torques_held_on_a_mesh_take_a_little_longer():
    least = optimal_slew(EFFORT.beam, EFFORT.angle, EFFORT.torque_limit).duration
    held = planned(EFFORT, 8, mapped=True, fastest=True)
    assert least < held.duration < 1.001 * least
    assert np.abs(held.left).max() <= EFFORT.torque_limit * (1.0 + 1e-6)
