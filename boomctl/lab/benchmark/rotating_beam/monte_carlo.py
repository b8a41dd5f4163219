"""Many machines that follow one slew, stepped together, beside a loop over them."""

from __future__ import annotations

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.report import Measured, Row, Tell, race
from boomctl.lab.benchmark.timing import Job, interleaved
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.slew.optimal import optimal_slew
from boomctl.slew.tracking.monte_carlo import TrackingStudy
from boomctl.slew.tracking.tracked import TrackedSlew

_SECTION = "256 machines follow a slew (LQG, SFOAM, 2 modes, 7 s at 200 Hz)"
_RUNS = 256  # machines of a study
_FEW = 8  # of them that the peer runs one by one, its time taken times as much
_RATIO = 10.0  # this package promised itself; 19 were measured
_RTOL, _ATOL = 1e-6, 1e-8  # of both
_EXACT = 1e-11  # rtol of the reference
_NOISE = {"hub_angle": 2e-5, "hub_speed": 2e-4, "root_moment": 0.2}  # rad, rad/s, N m: of the sensors
_ANGLE, _PLANNED, _LIMIT = np.pi / 2, 140.0, 200.0  # rad, N m, N m


def monte_carlo_rows(full: bool, tell: Tell) -> list[Row]:
    """Race one call for all machines against a loop of `simulate` over them."""
    tell("256 machines that follow a slew")
    beam = AssumedModesBeam(HubBeamParameters(), "sfoam", 2)
    tracked = optimal_slew(beam, _ANGLE, _PLANNED).track(
        torque_limit=_LIMIT, measurements=list(_NOISE), noise=_NOISE, settle=4.0
    )

    def together() -> TrackingStudy:
        return tracked.monte_carlo(
            _RUNS, stiffness=0.1, tip_mass=(0.0, 0.05), friction=(0.0, 2.0), rtol=_RTOL, atol=_ATOL
        )

    study = together()
    times = interleaved(
        {
            "ours": Job(lambda _: together()),
            "peer": Job(lambda _: [one(tracked, study, i, _RTOL) for i in range(_FEW)]),
        },
        5 if full else 3,
    )
    true = [one(tracked, study, i, _EXACT) for i in range(_FEW)]
    ours = max(_distance(study["tip_displacement"][i], true[i]) for i in range(_FEW))
    theirs = max(_distance(one(tracked, study, i, _RTOL), true[i]) for i in range(_FEW))
    peer = Measured(times["peer"] * _RUNS / _FEW, theirs)
    met = peer.seconds >= _RATIO * times["ours"] and ours <= _RTOL
    job = f"peer: one by one ({_FEW}, x {_RUNS // _FEW})"
    return [race(_SECTION, job, Measured(times["ours"], ours), peer, f">= {_RATIO:g}x", met)]


def one(tracked: TrackedSlew, study: TrackingStudy, run: int, rtol: float) -> Array:
    """Return the tip's displacement in one run of a study, by `simulate`."""
    drawn = {name: float(row[run]) for name, row in study.drawn.items()}
    true = tracked.machine.with_tip_mass(drawn["tip_mass"]).with_stiffness(drawn["stiffness"])
    seed = int(study.seeds[run])
    found = tracked.simulate(true, friction=drawn["friction"], seed=seed, rtol=rtol, atol=1e-2 * rtol)
    return found["tip_displacement"]


def _distance(found: Array, true: Array) -> float:
    return float(np.abs(found - true).max() / np.abs(true).max())
