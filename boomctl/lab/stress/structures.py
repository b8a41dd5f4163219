"""Beams, machines and the boom: elements, lengths, constraints, frequencies, units."""

from collections.abc import Iterator
from dataclasses import fields, replace
from functools import partial

import numpy as np

from boomctl.analysis.sigma import sigma
from boomctl.arrays import Array
from boomctl.boom.exact import exact_eigenfrequencies_hz, exact_frequency_response
from boomctl.boom.factory import spray_boom
from boomctl.boom.model import ACTUATORS, TIPS
from boomctl.boom.parameters import BoomParameters
from boomctl.lab.benchmark.scenes.boom_peak import peak_in_many_digits
from boomctl.lab.stress.case import SCALES, Case, Seen, each_relative, relative, rows
from boomctl.lab.stress.plants import in_other_units
from boomctl.lab.stress.references import (
    cantilever_frequencies,
    cantilever_response,
    dense_response,
    pinned_mesh_frequency,
)
from boomctl.structure.assembly import Assembly
from boomctl.structure.beams.elements import FiniteElements
from boomctl.structure.displacement_input import prescribe_displacement
from boomctl.structure.matrices import dense
from boomctl.structure.model import SecondOrderModel
from boomctl.structure.parts import (
    GROUND,
    Beam,
    BeamSection,
    CutJoint,
    Force,
    Output,
    RigidBody,
    SpringDamper,
    fixed,
    free,
    revolute,
)

_STRUCTURES, _BOOM, _EXACT = "General structures", "Spray boom", "Exact boom"
_EPS = float(np.finfo(float).eps)


def cases() -> Iterator[Case]:
    """Return the cases of structures."""
    yield from _general()
    yield from _booms()
    yield from _exact_booms()


def _general() -> Iterator[Case]:
    """Return the cases of beams and machines."""
    tried, digits = partial(rows, _STRUCTURES), "relative, sixty digits"

    def of_mesh(n: int) -> float:
        # beyond 1,000 a stiffness matrix carries the low modes: what would show in six digits is promised, or a warning
        return 1e-12 if n <= 100 else 1e-9 if n <= 1_000 else 1e-6

    what, measure = "first frequency of a pinned beam of equal elements", "relative, the mesh's own closed form"
    sizes = (1, 10, 100, 1_000, 10_000, 100_000)
    yield from tried(
        what, measure, _pinned, sizes, amount=_elements, promise=of_mesh, answered=lambda n: n <= 10_000, seconds=60.0
    )
    for shown, work in (("frequencies", _neighbours), ("response", _neighbour_response)):
        what, ratios = f"{shown} of a cantilever of neighbouring elements", (1.0, 1e2, 1e4, 1e6)
        yield from tried(
            what, digits, work, ratios, amount="lengths 1 : {:g}", promise=1e-9, answered=lambda ratio: ratio <= 1e4
        )
    yield from tried(
        "a bar held at one place and moved at another",
        "relative, the lever's law",
        _lever,
        (1.0, 1e-3, 1e-6, 1e-9, 1e-12, 1e-15),
        amount="{:g} of its length away",
        promise=lambda gap: max(1e-12, 8 * _EPS / gap),
        answered=lambda gap: gap >= 1e-6,
    )
    measure, gaps = "angle under a moment [rad]; none, or the first hinge's alone", (1e-3, 1e-8, 1e-12, 1e-14, 0.0)
    words = "{:g} of its length apart"
    yield from tried("a bar on two hinges", measure, _two_hinges, gaps, amount=words, promise=1e-9)
    what, measure = "state space of a floating machine, a spring beside a held actuator", "relative, without the spring"
    stiff = (1.0, 1e3, 1e6, 1e9)
    yield from tried(what, measure, _beside, stiff, amount="stiffness {:g}", promise=1e-9, answered=True)
    what, measure, away = "a held displacement prescribed once more", "none: nothing can have it", (0.0, 1.0, 30.0, 1e3)
    yield from tried(what, measure, _once_more, away, amount="{:g} m along its line", promise=None)
    yield from tried(
        "response of three masses, springs of unlike stiffness",
        digits,
        _chain,
        (1.0, 1e4, 1e8, 1e12, 1e16),
        amount="1 : {:g}",
        # the matrix itself loses these digits of its softest spring; from 1e-4 on a warning is promised
        promise=lambda stiff: max(1e-9, min(1e-4, 10 * _EPS * stiff)),
        answered=lambda stiff: stiff <= 1e8,
    )


def _booms() -> Iterator[Case]:
    """Return the cases of the spray boom's discretisations."""
    tried, digits = partial(rows, _BOOM), "relative, sixty digits"
    for unit in ("length", "force", "time"):
        what, measure = f"the boom in other units of {unit}", "relative, the law of scaling"
        yield from tried(what, measure, partial(_units, unit), SCALES, promise=1e-9)

    def of_mesh(n: int, rounding: float) -> float:
        # the error of cubic elements falls with the fourth power; what 6 and 100 leave was measured, and is doubled here
        return max(2.0 if n < 20 else 8e-4 * (100 / n) ** 4, rounding)

    yield from tried(
        "response against the exact boom",
        "of the peak, the exact boom",
        _boom_elements,
        (1, 6, 20, 100, 1_000, 10_000, 100_000),
        amount=_elements,
        promise=partial(of_mesh, rounding=1e-8),
        answered=lambda n: n <= 10_000,
        seconds=60.0,
    )
    yield from tried(
        "peak of the singular values against the exact boom",
        "relative, the exact boom's own peak",
        _boom_peak,
        (6, 20, 100, 500, 1_000, 10_000),
        amount=_elements,
        promise=partial(of_mesh, rounding=1e-6),
        answered=lambda n: n <= 1_000,
        full=lambda n: n > 1_000,
        seconds=240.0,
    )
    what, drawn = "response of a machine drawn at random, matrices as they stand", range(24)
    yield from tried(what, digits, _random_boom, drawn, promise=1e-7, answered=True, full=lambda seed: seed >= 4)
    what, omega, words = "response of 12 elements, matrices as they stand", (1e-6, 1e-3, 1.0, 1e3, 1e6), "{:g} rad/s"
    work = partial(_boom_as_it_stands, BoomParameters())
    yield from tried(what, digits, work, omega, amount=words, promise=1e-7, answered=True)

    def of_bending(omega: float) -> float:
        return max(1e-9, 3.0 * omega**2)

    what, measure, slow = "response to slow motion", "relative, that of a rigid boom", (1e-6, 1e-4, 1e-2)
    yield from tried(what, measure, _rigid_motion, slow, amount=words, promise=of_bending, answered=True)
    what, measure = "the state space, evaluated by python-control", "of the largest, the model's own response"
    left = {1: 1e-9, 12: 1e-9, 40: 1e-8, 100: 1e-7}
    yield from tried(
        what, measure, _exported, left, amount=_elements, promise=left.__getitem__, answered=True, seconds=40.0
    )
    for field in ("structural_damping", "hinge_damping", "cradle_damping"):
        what, factors = f"response of 12 elements, {field.replace('_', ' ')} multiplied", (0.0, 1e-6, 1.0, 1e3, 1e6)
        work = partial(_boom_damping, field)
        yield from tried(what, digits, work, factors, amount="by {:g}", promise=1e-7, answered=True)


def _exact_booms() -> Iterator[Case]:
    """Return the cases of the exact boom."""
    tried = partial(rows, _EXACT)
    what, measure = "response with springs close together", "of the peak, 40 elements of order 12"
    distances = (1e-1, 1e-2, 1e-3, 1e-4)
    yield from tried(what, measure, _exact_springs, distances, amount="{:g} m", promise=1e-9, seconds=40.0)

    def of_bending(omega: float) -> float:
        return max(1e-8, 3.0 * omega**2) if omega < 1.0 else 1e-8

    measure, omega = "of the largest, the law of reciprocity or of a rigid boom", (1e-6, 1e-3, 1e3, 1e6)
    yield from tried("response", measure, _exact_frequency, omega, amount="{:g} rad/s", promise=of_bending)
    what, measure, counts = "undamped frequencies", "relative, 120 elements of order 12", (1, 5, 50, 200)
    yield from tried(what, measure, _exact_eigen, counts, amount="the first {}", promise=1e-8, answered=True)


def _elements(n: int) -> str:
    return f"{n:,} element{'s' if n > 1 else ''}"


def _pinned(n: int) -> Seen:
    part = Beam("beam", GROUND.at(0.0), revolute(), (0.0, 0.0), (BeamSection(1.0, 1.0, 1.0),), FiniteElements(n))
    cut = CutJoint(part.at(1.0), GROUND.at(1.0), ("y",))
    model = Assembly((part,), (), (), (), (cut,)).assemble()
    held = prescribe_displacement(model, hold=list(model.inputs))
    found = 2 * np.pi * held.eigenfrequencies_hz(1)[0]
    return Seen(abs(found / pinned_mesh_frequency(n) - 1.0))


def _neighbouring(ratio: float) -> tuple[SecondOrderModel, tuple[float, ...]]:
    nodes = tuple(np.cumsum([0.0, 1.0, 1.0 / ratio, 1.0, 1.0, 1.0 / ratio]).tolist())
    section = BeamSection(nodes[-1], 1.0, 1.0)
    part = Beam("beam", GROUND.at(0.0), fixed(), (0.0, 0.0), (section,), FiniteElements(nodes))
    tip = part.at(nodes[-1])
    return Assembly((part,), (), (Force("f", tip),), (Output("y", tip),)).assemble(), nodes


def _neighbours(ratio: float) -> Seen:
    model, nodes = _neighbouring(ratio)
    return Seen(each_relative(2 * np.pi * model.eigenfrequencies_hz(3), cantilever_frequencies(nodes)[:3]))


def _neighbour_response(ratio: float) -> Seen:
    model, nodes = _neighbouring(ratio)
    omega = [0.0, 0.1, 1.0, 10.0]
    found = np.asarray(model.frequency_response(omega).frdata)[0, 0]
    return Seen(each_relative(found, cantilever_response(nodes, omega)))


def _bar() -> RigidBody:
    return RigidBody("bar", GROUND.at(0.0), revolute(), 1.0, 1.0, (0.5, 0.0))


def _lever(gap: float) -> Seen:
    """A mass hangs on the bar's end by a spring, so that something is left to move."""
    bar = replace(_bar(), joint=free("y", "theta"))
    mass = RigidBody("mass", GROUND.at(1.0), free("y"), 1.0)
    spring = SpringDamper(bar.at(1.0), mass.at(1.0), "y", 4.0, 0.1)
    forces = (Force("hold", bar.at(0.0)), Force("push", bar.at(gap)))
    model = Assembly((bar, mass), (spring,), forces, (Output("tip", mass.at(1.0)),)).assemble()
    moved = prescribe_displacement(model, ["push"], hold=["hold"])
    found = complex(np.asarray(moved.frequency_response([1.0], ["push"], ["tip"]).frdata)[0, 0, 0])
    follows = (4.0 + 0.1j) / (4.0 + 0.1j - 1.0)
    return Seen(abs(found * gap / follows - 1.0))


def _two_hinges(gap: float) -> Seen:
    """The bar turns by ``1 / (-w^2 J)`` on one hinge, ``J`` about it, and not at all on two."""
    bar = _bar()
    cut = CutJoint(bar.at(gap), GROUND.at(gap), ("y",))
    ends = (Force("moment", bar.at(0.0), "theta"),), (Output("angle", bar.at(0.0), "theta"),)
    spring = SpringDamper(bar.at(0.0), GROUND.at(0.0), "theta", 1.0, 0.1)
    model = Assembly((bar,), (spring,), *ends, (cut,)).assemble()
    held = prescribe_displacement(model, hold=[name for name in model.inputs if name != "moment"])
    if not held.n:
        return Seen(0.0, said="no motion is left")
    found = complex(np.asarray(held.frequency_response([1.0]).frdata)[0, 0, 0])
    free = 1.0 / (1.0 + 0.1j - 1.25)  # one hinge: inertia 1 about the middle, mass 1 half a length from the hinge
    return Seen(abs(found - free) if gap <= 1e-12 else abs(found))


_SLANT = 0.7  # direction of held actuators from the x axis [rad], along which nothing cancels exactly


def _beside(stiff: float) -> Seen:
    """Two bodies move freely but for two held actuators; the spring that is not beside them joins them."""
    one = RigidBody("one", GROUND.at(0.3, 0.1), free("x", "y", "theta"), 2.0, 0.7)
    two = RigidBody("two", one.at(1.1, 0.7), free("x", "y", "theta"), 1.0, 0.2)
    joined = SpringDamper(two.at(1.1, 0.7), one.at(1.1, 0.7), "x", 3.0, 0.1)
    slant = (two.at(0.4 + np.cos(_SLANT), 0.9 + np.sin(_SLANT)), GROUND.at(0.4 + np.cos(_SLANT), 0.9 + np.sin(_SLANT)))
    held = Force("hold", one.at(0.2, 0.6), 2.0 * _SLANT), Force("slant", two.at(0.4, 0.9), _SLANT)
    found = []
    for links in ((joined,), (joined, SpringDamper(*slant, _SLANT, stiff, 0.3))):
        ports = (*held, Force("push", two.at(0.0, 1.0), "x")), (Output("tip", two.at(2.0, 0.0)),)
        model = prescribe_displacement(Assembly((one, two), links, *ports).assemble(), hold=["hold", "slant"])
        found.append(np.asarray(model.to_statespace()(1.3j)))
    return Seen(relative(found[1], found[0]))


def _once_more(away: float) -> Seen:
    bar = RigidBody("bar", GROUND.at(0.0), free("x", "y", "theta"), 1.0, 1.0, (0.5, 0.0))
    place = bar.at(0.3 + away * np.cos(_SLANT), 0.1 + away * np.sin(_SLANT))
    forces = (Force("hold", bar.at(0.3, 0.1), _SLANT), Force("again", place, _SLANT))
    model = prescribe_displacement(Assembly((bar,), (), forces).assemble(), hold="hold")
    return Seen(0.0, said=f"{prescribe_displacement(model, 'again').n} coordinates left")


def _chain(stiff: float) -> Seen:
    k = np.array([1.0, stiff, 1.0])
    K = np.array([[k[0] + k[1], -k[1], 0.0], [-k[1], k[1] + k[2], -k[2]], [0.0, -k[2], k[2]]])
    M, C, one = np.eye(3), 0.01 * np.eye(3), np.array([0.0, 0.0, 1.0])
    omega = [0.0, 0.3, 1.0, 3.0]
    found = np.asarray(SecondOrderModel(M, C, K, {"f": one}, {"y": one}).frequency_response(omega).frdata)
    true = dense_response(M, C, K, one[:, None], one[None], omega)
    return Seen(each_relative(found, true))


# powers of length, force and time in the unit of each parameter; what is not listed is a length
_FORCE_TIME = {
    "platform_mass": (-1, 1, 2),
    "cradle_mass": (-1, 1, 2),
    "boom_mass": (-1, 1, 2),
    "platform_inertia": (1, 1, 2),
    "cradle_inertia": (1, 1, 2),
    "boom_inertia": (1, 1, 2),
    "density": (-4, 1, 2),
    "youngs_modulus": (-2, 1, 0),
    "spring_stiffness": (-1, 1, 0),
    "cradle_damping": (-1, 1, 1),
    "hinge_damping": (1, 1, 1),
    "structural_damping": (0, 0, 1),
}


def _units(unit: str, scale: float) -> Seen:
    p = BoomParameters()
    powers = {f.name: _FORCE_TIME.get(f.name, (1, 0, 0)) for f in fields(p)}
    slower = scale if unit == "time" else 1.0
    omega = np.array([0.1, 1.0, 1.5, 6.0, 30.0])
    found = spray_boom(in_other_units(p, powers, unit, scale)).frequency_response(omega / slower, ACTUATORS, TIPS)
    true = spray_boom(p).frequency_response(omega, ACTUATORS, TIPS)
    return Seen(each_relative(_norms(found.frdata), _norms(true.frdata)))


def _norms(G: Array) -> Array:
    return np.linalg.svd(np.moveaxis(np.asarray(G), 2, 0), compute_uv=False)[:, 0]


def _boom_elements(n: int) -> Seen:
    omega = np.geomspace(0.6, 60.0, 60 if n <= 10_000 else 6)  # each is a sparse factorisation there
    found = spray_boom(elements=n).frequency_response(omega, ACTUATORS, TIPS).frdata
    return Seen(relative(found, exact_frequency_response(BoomParameters(), omega, ACTUATORS, TIPS).frdata))


def _boom_peak(n: int) -> Seen:
    found = sigma(spray_boom(elements=n), [1.0])
    off = abs(found.peak / peak_in_many_digits(BoomParameters()) - 1.0)
    return Seen(float(off), found.certified, found.certificate.method)


def _random_boom(seed: int) -> Seen:
    rng, p = np.random.default_rng(seed), BoomParameters()
    drawn = {
        name: getattr(p, name) * 10.0 ** rng.uniform(-1.0, 1.0)
        for name in (
            "platform_mass",
            "cradle_mass",
            "spring_stiffness",
            "cradle_damping",
            "hinge_damping",
            "youngs_modulus",
        )
    }
    machine = replace(p, **drawn, spring_distance=p.spring_distance * rng.uniform(0.2, 2.0))
    return _boom_as_it_stands(machine, 0.1, 1.0, 20.0, 300.0)


def _boom_as_it_stands(p: BoomParameters, *omega: float) -> Seen:
    """Compare with the matrices of the model that its forces drive: their solution in sixty digits."""
    model = spray_boom(p, elements=12)
    found = np.asarray(model.frequency_response(omega, ["cradle"], list(TIPS)).frdata)
    ports = model.select(["cradle"], list(TIPS)).ports
    true = dense_response(dense(model.M), dense(model.C), dense(model.K), ports.B[0], ports.L[0], omega)
    return Seen(relative(found, true))


def _boom_damping(field: str, factor: float) -> Seen:
    p = BoomParameters()
    return _boom_as_it_stands(replace(p, **{field: factor * getattr(p, field)}), 0.1, 1.0, 20.0)


def _rigid(p: BoomParameters) -> Array:
    """Return what tips do when two actuators move a rigid boom."""
    half, arm = p.actuator_distance / 2, p.length / 2
    return np.array([[half + arm, half - arm], [half - arm, half + arm]]) / (2 * half)


def _rigid_motion(omega: float) -> Seen:
    found = np.asarray(spray_boom(elements=12).frequency_response([omega], ACTUATORS, TIPS).frdata)[:, :, 0]
    return Seen(relative(found, _rigid(BoomParameters())))


def _exported(n: int) -> Seen:
    model = spray_boom(elements=n, accelerometer_bandwidth_hz=20.0)
    omega = np.geomspace(0.3, 60.0, 12)
    true = np.asarray(model.frequency_response(omega).frdata)
    system = model.to_statespace()
    found = np.stack([np.asarray(system(1j * w)) for w in omega], axis=2)
    return Seen(max(relative(found[i, j], true[i, j]) for i in range(len(true)) for j in range(true.shape[1])))


def _exact_springs(distance: float) -> Seen:
    p = BoomParameters(spring_distance=distance)
    omega = np.geomspace(0.6, 60.0, 40)
    true = spray_boom(p, "high-order", 40).frequency_response(omega, ACTUATORS, TIPS).frdata
    return Seen(relative(exact_frequency_response(p, omega, ACTUATORS, TIPS).frdata, true))


def _exact_frequency(omega: float) -> Seen:
    p = BoomParameters()
    if omega < 1.0:
        found = np.asarray(exact_frequency_response(p, [omega], ACTUATORS, TIPS).frdata)[:, :, 0]
        return Seen(relative(found, _rigid(p)))
    # driven by forces, what one spring's force does to the other's stroke is mutual
    G = np.asarray(
        exact_frequency_response(
            p, [omega], ["suspension_left", "suspension_right"], ["stroke_left", "stroke_right"]
        ).frdata
    )[:, :, 0]
    return Seen(relative(G, G.T))


def _exact_eigen(count: int) -> Seen:
    p = BoomParameters(structural_damping=0.0, hinge_damping=0.0, cradle_damping=0.0)
    half, spring = p.length / 2, p.spring_distance / 2
    arm = np.concatenate([np.linspace(0.0, spring, 8), np.linspace(spring, half, 54)[1:]])
    model = spray_boom(p, "high-order", np.concatenate([-arm[:0:-1], arm]))
    return Seen(each_relative(exact_eigenfrequencies_hz(p, count, damped=False), model.eigenfrequencies_hz(count)))
