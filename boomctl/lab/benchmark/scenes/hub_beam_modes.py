"""The hub-beam under a torque with few and many modes, with and without axial ones, beside CasADi's IDAS."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

from boomctl.arrays import Array
from boomctl.lab.benchmark.peers.hub_beam import Drive, integrated, judge, machine, ours, until
from boomctl.lab.benchmark.peers.integrators import TORQUE
from boomctl.lab.benchmark.promise import Promise, Who, exact, times_as_fast, times_the_cost
from boomctl.lab.benchmark.scene import Extent, Scene, Setting
from boomctl.rotating_beam.factory import hub_beam

Plant = tuple[str, int]
"""Model and modes."""

_END: dict[Extent, float] = {"quick": 5.0, "whole": 60.0}  # s, of the motion
_PLANTS: dict[Extent, tuple[Plant, ...]] = {
    "quick": (("SFOAM", 1), ("FOAM", 1)),
    "whole": (("SFOAM", 1), ("SFOAM", 3), ("SFOAM", 5), ("SFOAM", 10), ("FOAM", 1), ("FOAM", 5)),
}
_STIFF: dict[Extent, tuple[Plant, ...]] = {"quick": (("FOAM", 2),), "whole": (("FOAM", 3), ("FOAM", 5), ("FOAM", 10))}
"""Plants with which IDAS takes half a minute for a motion."""
_PATIENT = 1  # modes of FOAM up to which IDAS is waited for where it is not asked for by name
_TOLERANCES = (1e-4, 1e-6, 1e-8)  # relative, of ours
_LADDER: dict[Extent, tuple[float, ...]] = {"quick": (1e-6,), "whole": (1e-4, 1e-6, 1e-8, 1e-10)}  # of IDAS
_TRUE = 1e-10  # relative tolerance of ours by which all are judged
_RATIO, _COST = 1.5, 10.0  # run time of IDAS over ours, and of FOAM over SFOAM: what this package promised itself


def hub_beam_modes(extent: Extent) -> Scene:
    """Return the scene of numbers of modes."""
    peers = [plant for plant in _PLANTS[extent] if plant[0] == "SFOAM" or plant[1] <= _PATIENT]
    cost = times_the_cost(Who("FOAM, 5 modes", error=1e-6), Who("SFOAM, 5 modes", error=1e-6), _COST)
    return _scene("hub-beam-modes", extent, _PLANTS[extent], peers, (cost,))


def hub_beam_stiff_modes(extent: Extent) -> Scene:
    """Return the scene of several axial modes, which take IDAS minutes."""
    return _scene("hub-beam-stiff-modes", extent, _STIFF[extent], _STIFF[extent])


def _scene(
    key: str,
    extent: Extent,
    plants: tuple[Plant, ...],
    peers: "list[Plant] | tuple[Plant, ...]",
    more: tuple[Promise, ...] = (),
) -> Scene:
    call = f"bc.sine_torque({TORQUE.amplitude:g}, {TORQUE.period:g}, {TORQUE.duration:g})"
    drive = Drive(TORQUE, until(_END[extent]), call)

    @cache
    def judged(model: str, modes: int) -> Array:
        return drive.tip(hub_beam(machine(), model.lower(), modes), _TRUE)

    def settings() -> Iterator[Setting]:
        for model, modes in plants:
            for setting in ours(drive, model.lower(), ((modes, rtol) for rtol in _TOLERANCES)):
                yield _of(setting, (model, modes), f"{model}, {modes} modes")
            if (model, modes) in peers:
                for setting in integrated(drive, model.lower(), modes, (("IDAS", _LADDER[extent]),)):
                    yield _of(setting, (model, modes), f"CasADi IDAS, {model}, {modes} modes")

    def promises() -> Iterator[Promise]:
        for model, modes in plants:
            name = f"{model}, {modes} modes"
            for error in _TOLERANCES[1:]:
                yield exact(Who(name, f"{modes} modes, rtol {error:.0e}"), error)
                if (model, modes) in peers:
                    yield times_as_fast(Who(name, error=error), Who(f"CasADi IDAS, {name}", error=error), _RATIO)

    return Scene(
        key=key,
        title=f"The hub-beam under a torque, {_END[extent]:g} s: models and modes, beside IDAS on the same equations",
        question=f"From the beam's parameters to the tip's displacement at {drive.timepts.size} instants.",
        measure=f"Largest error of the displacement over the largest displacement, against ours to {_TRUE:.0e}.",
        settings=tuple(settings()),
        error=lambda answer: judge(judged(*answer[0]))(answer[1]),
        promises=(*promises(), *more),
        shows="promises",
    )


def _of(setting: Setting, plant: Plant, name: str) -> Setting:
    """Return a setting whose answers say of which plant they are."""
    cold, hot = setting.cold, setting.hot
    return replace(
        setting,
        competitor=name,
        cold=None if cold is None else lambda change: (plant, cold(change)),
        hot=None if hot is None else lambda ready: (plant, hot(ready)),
    )
