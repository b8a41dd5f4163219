"""The hub-beam under a prescribed spin-up: the error of integrators on the same equations, and that of models."""

from boomctl.lab.benchmark.precision.scene import Extent, Scene, Setting
from boomctl.lab.benchmark.precision.scenes.hub_beam import (
    Drive,
    in_exudyn,
    integrated,
    judge,
    machine,
    missing_exudyn,
    ours,
    until,
)
from boomctl.lab.benchmark.rotating_beam.extrapolation import extrapolated
from boomctl.lab.benchmark.rotating_beam.peers import SPIN_UP, spin_up_ode
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam

_MODES = 5  # of SFOAM, of which the integrators are compared
_SUBSTEPS = 10  # of the reference, from instant to instant: with twice as many it moves by 7e-13 of the largest
_CALL = f"bc.spin_up({SPIN_UP.final_speed:g}, {SPIN_UP.duration:g})"
_END, _QUICK_END = 60.0, 10.0  # s, of the motion, and of the part of it by which a quick run compares models
_CONVERGED = (12, 1e-10)  # polynomials and tolerance of the geometrically exact beam from which models are measured

_TOLERANCES: dict[Extent, tuple[float, ...]] = {
    "quick": (1e-4, 1e-8, 1e-10),
    "whole": (1e-2, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10),
}
"""Relative tolerances of ours: from looser than anyone wants to rounding."""
_PEERS: dict[Extent, tuple[tuple[str, tuple[float, ...]], ...]] = {
    "quick": (("Radau", (1e-3,)), ("IDAS", (1e-4, 1e-8))),
    "whole": (
        ("DOP853", (1e-3, 1e-6, 1e-9, 1e-12)),
        ("Radau", (1e-2, 1e-3, 1e-5, 1e-7)),
        ("LSODA", (1e-3, 1e-6, 1e-9)),
        ("IDAS", (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)),
        ("CVODES", (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    ),
}
"""Methods and relative tolerances of the others; a quick run has the fastest that are known."""
_MODELS: dict[Extent, dict[str, tuple[tuple[int, float], ...]]] = {
    "quick": {
        "tlam": ((3, 1e-3),),
        "sfoam": ((1, 1e-3), (3, 1e-3), (5, 1e-5)),
        "foam": ((3, 1e-3),),
        "geometrically-exact": ((3, 1e-3), (5, 1e-5)),
    },
    "whole": {
        "tlam": ((1, 1e-3), (3, 1e-3), (5, 1e-3)),
        "sfoam": tuple((modes, 1e-5) for modes in (1, 2, 3, 4, 5, 7, 10)),
        "foam": tuple((modes, 1e-5) for modes in (1, 2, 3, 5, 7, 10)),
        "cfoam": tuple((modes, 1e-5) for modes in (1, 2, 3, 5, 7)),
        "geometrically-exact": ((2, 1e-3), (3, 1e-3), (4, 1e-4), (5, 1e-5), (6, 1e-6), (8, 1e-8)),
    },
}
"""Modes and relative tolerances of each model of ours; the tolerances are far below the error of the model."""
_MODEL_PEERS: dict[Extent, tuple[tuple[int, tuple[tuple[str, tuple[float, ...]], ...]], ...]] = {
    "quick": ((3, (("IDAS", (1e-4,)),)),),
    "whole": tuple((modes, (("Radau", (1e-3,)), ("IDAS", (1e-4,)))) for modes in (1, 3, 5)),
}
"""Modes, methods and relative tolerances of the others on SFOAM's equations."""
_EXUDYN: dict[Extent, tuple[tuple[int, float], ...]] = {
    "quick": ((4, 0.02),),
    "whole": ((4, 0.04), (4, 0.02), (8, 0.01), (8, 0.005), (16, 0.0025)),
}
"""Elements and time steps [s], from fast to exact."""


def hub_beam_motion(extent: Extent) -> Scene:
    """Return the scene of integrators: the spin-up of SFOAM."""
    drive = Drive(SPIN_UP, until(_END), _CALL)
    exact = extrapolated(spin_up_ode(AssumedModesBeam(machine(), "sfoam", _MODES)), drive.timepts, _SUBSTEPS)
    mine = ours(drive, "sfoam", ((_MODES, rtol) for rtol in _TOLERANCES[extent]))
    return Scene(
        key="hub-beam-motion",
        title=f"Spin-up of the hub-beam, {_END:g} s: integrators on the same equations",
        question=f"From the beam's parameters to the tip's displacement at {drive.timepts.size} instants, the hub spun up to"
        f" {SPIN_UP.final_speed:g} rad/s in {SPIN_UP.duration:g} s; SFOAM, {_MODES} modes.",
        measure="Largest error of the displacement over the largest displacement, against extrapolation of order 16 in steps"
        " of 10 ms, which agrees to 1e-12 with steps of half that.",
        settings=(*mine, *integrated(drive, "sfoam", _MODES, _PEERS[extent])),
        error=judge(exact),
        remarks=(
            "Everybody solves the same equations; the peers' modal integrals are ours, computed in their cold calls too.",
            "Hot: the beam of ours and the integrator of CasADi are ready; solve_ivp has nothing to keep.",
            "Ours starts with steps in which every mode vibrates exactly: they are more exact than the loosest tolerances ask"
            " for, and none cheaper.",
        ),
    )


def hub_beam_models(extent: Extent) -> Scene:
    """Return the scene of models: the spin-up against the geometrically exact beam."""
    drive = Drive(SPIN_UP, until(_END if extent == "whole" else _QUICK_END), _CALL)
    modes, rtol = _CONVERGED
    settings: list[Setting] = []
    for model, cases in _MODELS[extent].items():
        settings += ours(drive, model, cases)
    for number, methods in _MODEL_PEERS[extent]:
        settings += integrated(drive, "sfoam", number, methods)
    return Scene(
        key="hub-beam-models",
        title=f"Spin-up of the hub-beam, {drive.timepts[-1]:g} s: models against the geometrically exact beam",
        question=f"From the beam's parameters to the tip's displacement at {drive.timepts.size} instants, the hub spun up to"
        f" {SPIN_UP.final_speed:g} rad/s in {SPIN_UP.duration:g} s.",
        measure="Largest error of the displacement over the largest displacement, against the geometrically exact beam with"
        f" {modes} polynomials to {rtol:.0e}, which agrees to 1e-9 with 10 polynomials.",
        settings=(*settings, *in_exudyn(drive, _EXUDYN[extent])),
        error=judge(drive.tip(hub_beam(machine(), "geometrically-exact", modes), rtol)),
        missing=missing_exudyn(),
        remarks=(
            "Of TLAM, SFOAM, FOAM and CFOAM the error that is left with many modes is that of the model.",
            "exudyn has another discretisation of the same beam (ANCF cables); it is judged by the same reference.",
            "solve_ivp and CasADi solve the equations of SFOAM; their modal integrals are ours.",
        ),
    )
