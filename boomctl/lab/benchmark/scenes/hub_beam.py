"""The hub-beam spun up, and driven by a torque: the error of integrators on the same equations, and that of models."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from boomctl.lab.benchmark.peers.hub_beam import Drive, in_exudyn, integrated, judge, machine, ours, until
from boomctl.lab.benchmark.peers.integrators import SPIN_UP, TORQUE, Ode
from boomctl.lab.benchmark.promise import Promise, Who, exact, number, times_as_fast
from boomctl.lab.benchmark.references.extrapolation import extrapolated
from boomctl.lab.benchmark.scene import Extent, Scene, Setting, missing
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import SineTorque, SpinUp

_MODES = 5  # of SFOAM, of which the integrators are compared
_SUBSTEPS = 10  # of the reference, from instant to instant: with twice as many it moves by 7e-13 of the largest
_END, _QUICK_END = 60.0, 10.0  # s, of the motion, and of the part of it by which a quick run compares models
_ERROR = 1e-6  # of the tip, for which run times are promised
_MODEL_ERROR = 1e-3  # to which exudyn is refined beside SFOAM, whose own error is below that
_LEFT = "error of what is left after the manoeuvre"
_HOT = "Hot: the beam of ours and the integrator of CasADi are ready; solve_ivp has nothing to keep."
_ANCF = "exudyn has another discretisation of the same beam (ANCF cables); it is judged by the same reference."

Cases = tuple[tuple[int, float], ...]
"""Modes (elements) and relative tolerances (time steps [s])."""
Methods = tuple[tuple[str, tuple[float, ...]], ...]
"""Integrators of others, and their relative tolerances; a quick run has the fastest that are known."""


@dataclass(frozen=True)
class _Study:
    """A manoeuvre, and everybody's settings.

    ``tolerances`` and ``peers`` are of SFOAM's equations; ``models`` are of all models, modes and tolerances far below the
    error of the model; ``model_peers`` solve SFOAM with some numbers of modes; ``exudyn`` are elements and time steps [s];
    ``converged`` are polynomials and tolerance of the geometrically exact beam from which models are measured, over
    ``models_end`` [s].
    """

    key: str
    manoeuvre: SpinUp | SineTorque
    call: str
    title: str
    words: str
    end_of_drive: float
    models_end: Mapping[Extent, float]
    converged: Mapping[Extent, tuple[int, float]]
    agrees: str
    tolerances: Mapping[Extent, tuple[float, ...]]
    peers: Mapping[Extent, Methods]
    models: Mapping[Extent, Mapping[str, Cases]]
    model_peers: Mapping[Extent, tuple[tuple[int, ...], Methods]]
    exudyn: Mapping[Extent, Cases]
    remarks: tuple[str, ...]
    model_remarks: tuple[str, ...]
    promises: tuple[Promise, ...]
    model_promises: tuple[Promise, ...] = ()


_OURS, _SOLVE_IVP, _IDAS = Who("SFOAM", error=_ERROR), Who("solve_ivp", error=_ERROR), Who("CasADi IDAS", error=_ERROR)

# prescribed motion: tolerances of every kind of work, peers at what they can keep
_SPUN = _Study(
    key="hub-beam-motion",
    manoeuvre=SPIN_UP,
    call=f"bc.spin_up({SPIN_UP.final_speed:g}, {SPIN_UP.duration:g})",
    title="Spin-up of the hub-beam",
    words=f"the hub spun up to {SPIN_UP.final_speed:g} rad/s in {SPIN_UP.duration:g} s",
    end_of_drive=SPIN_UP.duration,
    models_end={"quick": _QUICK_END, "whole": _END},
    converged={"quick": (12, 1e-10), "whole": (12, 1e-10)},
    agrees="which agrees to 1e-9 with 10 polynomials",
    tolerances={"quick": (1e-4, 1e-8, 1e-10), "whole": (1e-2, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)},
    peers={
        "quick": (("Radau", (1e-3,)), ("IDAS", (1e-4, 1e-8))),
        "whole": (
            ("DOP853", (1e-3, 1e-6, 1e-9, 1e-12)),
            ("Radau", (1e-2, 1e-3, 1e-5, 1e-7)),
            ("LSODA", (1e-3, 1e-6, 1e-9)),
            ("IDAS", (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)),
            ("CVODES", (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
        ),
    },
    models={
        "quick": {
            "tlam": ((3, 1e-3),),
            "sfoam": ((1, 1e-3), (2, 1e-3), (5, 1e-5)),
            "foam": ((3, 1e-3),),
            "geometrically-exact": ((3, 1e-3), (5, 1e-5)),
        },
        "whole": {
            "tlam": ((3, 1e-3),),
            "sfoam": tuple((modes, 1e-5) for modes in (1, 2, 3, 4, 5, 7, 10)),
            "foam": tuple((modes, 1e-5) for modes in (1, 2, 3, 5, 7, 10)),
            "cfoam": tuple((modes, 1e-5) for modes in (1, 2, 3, 5, 7)),
            "geometrically-exact": ((2, 1e-3), (3, 1e-3), (4, 1e-4), (5, 1e-5), (6, 1e-6), (8, 1e-8)),
        },
    },
    model_peers={
        "quick": ((2,), (("IDAS", (1e-2,)),)),
        "whole": ((1, 2, 3, 4), (("Radau", (1e-2, 1e-3)), ("IDAS", (1e-2, 1e-3, 1e-4, 1e-5)))),
    },
    exudyn={"quick": ((4, 0.02),), "whole": ((4, 0.02), (4, 0.01), (6, 0.005), (8, 0.0025))},
    remarks=(
        "Everybody solves the same equations; the peers' modal integrals are ours, computed in their cold calls too.",
        "Ours starts with steps in which every mode vibrates exactly: they are more exact than the loosest tolerances ask"
        " for, and none cheaper.",
    ),
    model_remarks=(
        "Of TLAM, SFOAM, FOAM and CFOAM the error that is left with many modes is that of the model.",
        "solve_ivp and CasADi solve the equations of SFOAM; their modal integrals are ours.",
        "Where others are ahead, with the model ready: IDAS at its loosest, to 0.5 % in 0.5 to 0.6 of our time (10 s: 0.3)."
        " Ours takes 0.8 ms to 0.2 %, at any tolerance: steps in which every mode vibrates exactly are 560 calls.",
    ),
    promises=(
        times_as_fast(_OURS, _SOLVE_IVP, 100.0),
        times_as_fast(_OURS, _IDAS, 15.0),
        number(Who("SFOAM", f"{_MODES} modes, rtol 1e-04"), _LEFT, 1e-5),
        exact(Who("SFOAM", f"{_MODES} modes, rtol 1e-08"), _ERROR),
    ),
    model_promises=(times_as_fast(Who("SFOAM", "5 modes, rtol 1e-05"), Who("exudyn", error=_MODEL_ERROR), 300.0),),
)
# the same under a torque, where the peers' looser settings are the interesting ones
_DRIVEN = _Study(
    key="hub-beam-torque",
    manoeuvre=TORQUE,
    call=f"bc.sine_torque({TORQUE.amplitude:g}, {TORQUE.period:g}, {TORQUE.duration:g})",
    title="The hub-beam under a torque",
    words=f"under one period of a sine of {TORQUE.amplitude:g} N m in {TORQUE.duration:g} s",
    end_of_drive=TORQUE.duration,
    models_end={"quick": _QUICK_END, "whole": 30.0},
    converged={"quick": (6, 1e-7), "whole": (8, 1e-8)},
    agrees="whose distance from more polynomials is below 1e-5",
    tolerances={
        "quick": (1e-2, 1e-6, 1e-8),
        "whole": (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10),
    },
    peers={
        "quick": (("IDAS", (1e-3, 1e-6)),),
        "whole": (
            ("DOP853", (1e-6,)),
            ("Radau", (1e-3,)),
            ("LSODA", (1e-3, 1e-6)),
            ("IDAS", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)),
            ("CVODES", (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
        ),
    },
    models={
        "quick": {
            "tlam": ((3, 1e-3),),
            "sfoam": ((1, 1e-2), (2, 1e-2), (5, 1e-2)),
            "foam": ((3, 1e-2),),
            "geometrically-exact": ((3, 1e-3), (4, 1e-4)),
        },
        "whole": {
            "tlam": ((3, 1e-3),),
            "sfoam": tuple((modes, 1e-2) for modes in (1, 2, 3, 5, 10)),
            "foam": tuple((modes, 1e-2) for modes in (1, 2, 3, 5, 10)),
            "cfoam": tuple((modes, 1e-3) for modes in (1, 2, 3, 5)),
            "geometrically-exact": ((2, 1e-2), (3, 1e-3), (4, 1e-4), (5, 1e-5), (6, 1e-6)),
        },
    },
    model_peers={
        "quick": ((2,), (("IDAS", (1e-3,)),)),
        "whole": ((1, 2, 3), (("IDAS", (1e-2, 1e-3, 1e-4)), ("CVODES", (1e-3, 1e-4)))),
    },
    exudyn={"quick": ((4, 0.02),), "whole": ((4, 0.02), (6, 0.01), (8, 0.01), (8, 0.005), (12, 0.0025))},
    remarks=(
        "Everybody solves the same equations; solve_ivp's derivative is ours, CasADi's is derived from our energies.",
        "Where others are as fast: IDAS to an error of 15 %. Ours is at 1e-5 with two windows in six sweeps and two, the"
        " fewest there are: products of matrices take a twentieth of the time, what is left are Python calls.",
    ),
    model_remarks=(
        "Of TLAM, SFOAM, FOAM and CFOAM the error that is left with many modes is that of the model: the tip moves by a"
        " seventh of the length.",
        "CasADi solves the equations of SFOAM.",
        "Where others are ahead: IDAS and CVODES with one mode (1.2 % and more) take 0.5 to 0.6 of our time, with two (0.8 %)"
        " 0.6 to 0.8; with the model ready 0.2 to 0.3 and 0.35 to 0.5: ours takes 4 ms for 2400 calls.",
        "exudyn, compiled, takes 0.6 to 0.9 of our time to 0.6 %, and 0.8 to 1.4 of it to 0.2 % and 0.1 %: the exact beam of"
        " ours solves each step by NumPy, 0.3 ms, and repeats the motion with shorter steps until two agree, so that its"
        " error is known: 600 and 900 steps at all tolerances down to 1e-5.",
    ),
    promises=(
        times_as_fast(_OURS, _IDAS, 1.5),
        exact(Who("SFOAM", f"{_MODES} modes, rtol 1e-06"), 1e-6),
        exact(Who("SFOAM", f"{_MODES} modes, rtol 1e-08"), 1e-8),
    ),
)


_STUDIES = {"spin-up": _SPUN, "torque": _DRIVEN}


def integrators(name: str, extent: Extent) -> Scene:
    """Return the scene of integrators: SFOAM spun up, or under a torque."""
    study = _STUDIES[name]
    drive = Drive(study.manoeuvre, until(_END), study.call)
    true = cache(
        lambda: extrapolated(
            Ode.of(AssumedModesBeam(machine(), "sfoam", _MODES), study.manoeuvre), drive.timepts, _SUBSTEPS
        )
    )
    after = drive.timepts > study.end_of_drive
    mine = ours(drive, "sfoam", ((_MODES, rtol) for rtol in study.tolerances[extent]))
    return Scene(
        key=study.key,
        title=f"{study.title}, {_END:g} s: integrators on the same equations",
        question=f"From the beam's parameters to the tip's displacement at {drive.timepts.size} instants, {study.words};"
        f" SFOAM, {_MODES} modes.",
        measure="Largest error of the displacement over the largest displacement, against extrapolation of order 16 in steps"
        " of 10 ms, which agrees to 1e-12 with steps of half that.",
        settings=(*mine, *integrated(drive, "sfoam", _MODES, study.peers[extent])),
        error=lambda tip: judge(true())(tip),
        remarks=(_HOT, *study.remarks),
        promises=study.promises,
        found=lambda tip: {_LEFT: judge(true()[after])(tip[after])},
    )


def models(name: str, extent: Extent) -> Scene:
    """Return the scene of models: either motion against that of the geometrically exact beam."""
    study = _STUDIES[name]
    drive = Drive(study.manoeuvre, until(study.models_end[extent]), study.call)
    modes, rtol = study.converged[extent]
    true = cache(lambda: drive.tip(hub_beam(machine(), "geometrically-exact", modes), rtol))
    settings: list[Setting] = []
    for model, cases in study.models[extent].items():
        settings += ours(drive, model, cases)
    numbers_of_modes, methods = study.model_peers[extent]
    for each in numbers_of_modes:
        settings += integrated(drive, "sfoam", each, methods)
    return Scene(
        key="hub-beam-models" if study is _SPUN else f"{study.key}-models",
        title=f"{study.title}, {drive.timepts[-1]:g} s: models against the geometrically exact beam",
        question=f"From the beam's parameters to the tip's displacement at {drive.timepts.size} instants, {study.words}.",
        measure="Largest error of the displacement over the largest displacement, against the geometrically exact beam with"
        f" {modes} polynomials to {rtol:.0e}, {study.agrees}.",
        settings=(*settings, *in_exudyn(drive, study.exudyn[extent])),
        error=lambda tip: judge(true())(tip),
        missing=missing(exudyn="exudyn"),
        remarks=(_ANCF, *study.model_remarks),
        promises=study.model_promises,
    )
