"""The hub-beam driven by a torque: the error of integrators on the same equations, and that of models."""

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
from boomctl.lab.benchmark.rotating_beam.peers import TORQUE, torque_ode
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam

_MODES = 5  # of SFOAM, of which the integrators are compared
_SUBSTEPS = 10  # of the reference, from instant to instant: with twice as many it moves by 5e-13 of the largest
_CALL = f"bc.sine_torque({TORQUE.amplitude:g}, {TORQUE.period:g}, {TORQUE.duration:g})"
_END, _MODELS_END, _QUICK_END = (
    60.0,
    30.0,
    10.0,
)  # s, of the motion; of that by which models are compared, whole and quick
_CONVERGED: dict[Extent, tuple[int, float]] = {"quick": (6, 1e-7), "whole": (8, 1e-8)}
"""Polynomials and tolerance of the geometrically exact beam from which models are measured."""

_TOLERANCES: dict[Extent, tuple[float, ...]] = {
    "quick": (1e-2, 1e-6, 1e-8),
    "whole": (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10),
}
"""Relative tolerances of ours: from looser than anyone wants to rounding."""
_PEERS: dict[Extent, tuple[tuple[str, tuple[float, ...]], ...]] = {
    "quick": (("IDAS", (1e-3, 1e-6)),),
    "whole": (
        ("DOP853", (1e-6,)),
        ("Radau", (1e-3,)),
        ("LSODA", (1e-3, 1e-6)),
        ("IDAS", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)),
        ("CVODES", (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    ),
}
"""Methods and relative tolerances of the others; a quick run has the fastest that are known."""
_MODELS: dict[Extent, dict[str, tuple[tuple[int, float], ...]]] = {
    "quick": {
        "tlam": ((3, 1e-3),),
        "sfoam": ((1, 1e-2), (3, 1e-2), (5, 1e-2)),
        "foam": ((3, 1e-2),),
        "geometrically-exact": ((3, 1e-3), (4, 1e-4)),
    },
    "whole": {
        "tlam": ((1, 1e-3), (3, 1e-3), (5, 1e-3)),
        "sfoam": tuple((modes, 1e-2) for modes in (1, 2, 3, 5, 10)),
        "foam": tuple((modes, 1e-2) for modes in (1, 2, 3, 5, 10)),
        "cfoam": tuple((modes, 1e-3) for modes in (1, 2, 3, 5)),
        "geometrically-exact": ((2, 1e-2), (3, 1e-3), (4, 1e-4), (5, 1e-5), (6, 1e-6)),
    },
}
"""Modes and relative tolerances of each model of ours; the tolerances are far below the error of the model."""
_MODEL_PEERS: dict[Extent, tuple[tuple[int, tuple[tuple[str, tuple[float, ...]], ...]], ...]] = {
    "quick": ((3, (("IDAS", (1e-4,)),)),),
    "whole": tuple((modes, (("IDAS", (1e-4,)),)) for modes in (1, 3, 5)),
}
"""Modes, methods and relative tolerances of the others on SFOAM's equations."""
_EXUDYN: dict[Extent, tuple[tuple[int, float], ...]] = {
    "quick": ((4, 0.02),),
    "whole": ((4, 0.05), (4, 0.02), (8, 0.01), (8, 0.005), (16, 0.0025)),
}
"""Elements and time steps [s], from fast to exact."""


def hub_beam_torque(extent: Extent) -> Scene:
    """Return the scene of integrators: SFOAM under a torque."""
    drive = Drive(TORQUE, until(_END), _CALL)
    exact = extrapolated(torque_ode(AssumedModesBeam(machine(), "sfoam", _MODES), TORQUE), drive.timepts, _SUBSTEPS)
    mine = ours(drive, "sfoam", ((_MODES, rtol) for rtol in _TOLERANCES[extent]))
    return Scene(
        key="hub-beam-torque",
        title=f"The hub-beam under a torque, {_END:g} s: integrators on the same equations",
        question=f"From the beam's parameters to the tip's displacement at {drive.timepts.size} instants, under one period of"
        f" a sine of {TORQUE.amplitude:g} N m in {TORQUE.duration:g} s; SFOAM, {_MODES} modes.",
        measure="Largest error of the displacement over the largest displacement, against extrapolation of order 16 in steps"
        " of 10 ms on the equations that CasADi derives from the energies, which agrees to 1e-12 with steps of half that.",
        settings=(*mine, *integrated(drive, "sfoam", _MODES, _PEERS[extent])),
        error=judge(exact),
        remarks=(
            "Everybody solves the same equations; solve_ivp's derivative is ours, CasADi's is derived from our energies.",
            "Hot: the beam of ours and the integrator of CasADi are ready; solve_ivp has nothing to keep.",
            "Where others are ahead: IDAS takes two thirds of the time to an error of 17 %. Ours is at 1e-4 with the longest"
            " windows in which it follows the slow modes: there is nothing to save.",
        ),
    )


def hub_beam_torque_models(extent: Extent) -> Scene:
    """Return the scene of models: the torque-driven motion against the geometrically exact beam."""
    drive = Drive(TORQUE, until(_MODELS_END if extent == "whole" else _QUICK_END), _CALL)
    modes, rtol = _CONVERGED[extent]
    settings: list[Setting] = []
    for model, cases in _MODELS[extent].items():
        settings += ours(drive, model, cases)
    for number, methods in _MODEL_PEERS[extent]:
        settings += integrated(drive, "sfoam", number, methods)
    return Scene(
        key="hub-beam-torque-models",
        title=f"The hub-beam under a torque, {drive.timepts[-1]:g} s: models against the geometrically exact beam",
        question=f"From the beam's parameters to the tip's displacement at {drive.timepts.size} instants, under one period of"
        f" a sine of {TORQUE.amplitude:g} N m in {TORQUE.duration:g} s.",
        measure="Largest error of the displacement over the largest displacement, against the geometrically exact beam with"
        f" {modes} polynomials to {rtol:.0e}, whose distance from more polynomials is below 1e-5.",
        settings=(*settings, *in_exudyn(drive, _EXUDYN[extent])),
        error=judge(drive.tip(hub_beam(machine(), "geometrically-exact", modes), rtol)),
        missing=missing_exudyn(),
        remarks=(
            "Of TLAM, SFOAM, FOAM and CFOAM the error that is left with many modes is that of the model: the tip moves by a"
            " seventh of the length.",
            "exudyn has another discretisation of the same beam (ANCF cables); it is judged by the same reference.",
            "CasADi solves the equations of SFOAM.",
            "Where others are ahead: exudyn is compiled; the exact beam of ours solves each step by NumPy and repeats the"
            " motion with half the step until two agree, so that its error is known. IDAS with one mode takes two"
            " milliseconds, which ours takes for Python calls alone.",
        ),
    )
