"""Scenes of the hub-beam: the tip's displacement in a spin-up, and under a torque.

Errors are those of the model and of the integration together, against the geometrically exact beam.
Other programs: SciPy's and CasADi's integrators on the equations of assumed modes.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.benchmark.scene import Scene, Setting, relative_error, settings, sized
from boomctl.maneuvers import SineTorque, SpinUp
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.parameters import HubBeamParameters

SPIN_UP = SpinUp(2.8, 30.0)  # rad/s, s: of Bai et al. (2009), Fig. 5, near the divergence speed of TLAM
TORQUE = SineTorque(200.0, 10.0, 10.0)  # N m, s, s: of Fig. 8
_SUNDIALS, _SCIPY = ("IDAS", "CVODES"), ("Radau", "DOP853", "LSODA")
_ATOL = 1e-15  # m: of ours, so that the relative tolerance alone decides

Maneuver = SpinUp | SineTorque
Cases = tuple[tuple[int, float], ...]
"""Modes or polynomials, and the relative tolerance of the integration."""


def time_points(end: float) -> Array:
    """Return times [s], ten per second."""
    return np.linspace(0.0, end, round(10.0 * end) + 1)


def _settings(maneuver: Maneuver, timepts: Array, method: str, cases: Cases) -> Iterator[Setting]:
    """Yield the settings of a model of this package, or of a general-purpose integrator on the equations of SFOAM."""
    integrate: Any = sundials if method in _SUNDIALS else scipy_motion if method in _SCIPY else None

    def ours(modes: int, rtol: float, problem: Any, change: float) -> Array:
        beam = hub_beam(machine(change), method, modes)  # type: ignore[call-overload]
        return beam.simulate(maneuver, timepts, rtol=rtol, atol=_ATOL).tip_displacement

    if integrate is None:
        name = "exact beam" if method == "geometrically-exact" else method.upper()
        call = f'bc.hub_beam(p, "{method}", {{}}).simulate(maneuver, t, rtol={{:g}})'
        return settings(name, "{} modes, rtol {:.0e}", cases, ours, ours=True, call=call)

    def theirs(modes: int, rtol: float, problem: Any, change: float) -> Array:
        return integrate(AssumedModesBeam(machine(change), "sfoam", modes), maneuver, timepts, method, rtol)

    name = f"{'CasADi' if integrate is sundials else 'SciPy'} {method}, SFOAM"
    return settings(name, "{} modes, rtol {:.0e}", cases, theirs, modules=("casadi",))


def _scene(
    title: str, words: str, maneuver: Maneuver, end: float, reference: tuple[int, float], methods: dict[str, Cases]
) -> Scene:
    timepts = time_points(end)
    meshes = tuple((modes, 1e-6) for modes in (2, 4, 8))
    (exact,) = _settings(maneuver, timepts, "geometrically-exact", (reference,))
    return Scene(
        title=title,
        question=f"From the beam's parameters to the tip's displacement in {end:g} s, ten times a second, {words}.",
        measure=f"Largest error over the largest displacement, against the exact beam with {reference[0]} polynomials.",
        reference=lambda problem: exact.solve(problem, 0.0),
        error=relative_error(),
        methods=(
            *(s for method, cases in methods.items() for s in _settings(maneuver, timepts, method, cases)),
            *sized(*(_settings(maneuver, timepts, method, meshes) for method in ("sfoam", "CVODES"))),
        ),
        remarks=(
            "SFOAM and FOAM end at the error of the model for any number of modes.",
            "Others solve SFOAM's equations; their modal integrals and derivatives are ours, computed in their calls.",
        ),
    )


def hub_spin_up() -> Scene:
    """Return the scene of a prescribed spin-up."""
    ladder = ((1, 1e-2), (2, 1e-3), (2, 1e-4), (3, 1e-5), (4, 1e-6), (5, 1e-6))
    methods = {
        "tlam": ((3, 1e-3),),
        "sfoam": ((1, 1e-4), (2, 1e-4), (3, 1e-4), (4, 1e-5), (5, 1e-5), (5, 1e-8)),
        "foam": ((1, 1e-4), (2, 1e-4), (3, 1e-5), (5, 1e-5)),
        "cfoam": ((1, 1e-4), (3, 1e-5)),
        "geometrically-exact": ((2, 1e-3), (3, 1e-3), (4, 1e-4), (5, 1e-5), (6, 1e-6), (8, 1e-8)),
        **dict.fromkeys(("Radau", "DOP853", "LSODA"), ladder[:3]),
        **dict.fromkeys(("IDAS", "CVODES"), ladder),
    }
    words = f"the hub spun up to {SPIN_UP.final_speed:g} rad/s in {SPIN_UP.duration:g} s"
    return _scene("Spin-up of the hub-beam", words, SPIN_UP, 60.0, (12, 1e-10), methods)


def hub_torque() -> Scene:
    """Return the scene of a torque."""
    ladder = ((1, 1e-2), (1, 1e-3), (2, 1e-3), (2, 1e-4), (3, 1e-5))
    methods = {
        "tlam": ((3, 1e-3),),
        "sfoam": ((1, 1e-2), (2, 1e-2), (2, 1e-3), (3, 1e-4), (5, 1e-6)),
        "foam": ((1, 1e-2), (2, 1e-2), (3, 1e-4), (5, 1e-4)),
        "cfoam": ((1, 1e-3), (2, 1e-3)),
        "geometrically-exact": ((2, 1e-2), (3, 1e-3), (4, 1e-4), (5, 1e-5), (6, 1e-6)),
        "Radau": ladder[:2],
        "LSODA": ladder[:3],
        **dict.fromkeys(("IDAS", "CVODES"), ladder),
    }
    words = f"under one period of a sine of {TORQUE.amplitude:g} N m in {TORQUE.duration:g} s"
    return _scene("Hub-beam with an applied torque", words, TORQUE, 30.0, (8, 1e-8), methods)


def machine(change: float = 0.0) -> HubBeamParameters:
    """Return the machine of Bai et al. (2009) with another length, on which everything depends."""
    p = HubBeamParameters()
    return replace(p, length=p.length * (1.0 + change))


def equations(beam: AssumedModesBeam, maneuver: SpinUp | SineTorque) -> tuple[dict[str, Any], Array]:
    """Return the differential equations in CasADi, from rest, and the row that reads the tip off the states [m].

    Parameters
    ----------
    beam : AssumedModesBeam
        Without axial modes where the motion is prescribed.
    maneuver : SpinUp or SineTorque
    """
    import casadi as ca

    t = ca.SX.sym("t")
    if isinstance(maneuver, SineTorque):
        size = beam.equations.size
        x = ca.SX.sym("x", 2 * size)
        sine = maneuver.amplitude * ca.sin(2.0 * np.pi * t / maneuver.period)
        rate, _ = beam.to_casadi()(x, ca.if_else(t <= maneuver.duration, sine, 0.0))
        return {"x": x, "t": t, "ode": rate}, np.concatenate([[0.0], beam.equations.tip.transverse, np.zeros(size)])
    m, w, duration = beam._integrals, maneuver.final_speed, maneuver.duration
    n = m.V2.size
    x = ca.SX.sym("x", 2 * n)
    phase = 2.0 * np.pi * ca.fmin(t / duration, 1.0)
    speed, turning = w * (phase - ca.sin(phase)) / (2.0 * np.pi), w / duration * (1.0 - ca.cos(phase))
    force = speed**2 * ca.mtimes(ca.DM(m.M2 - m.D), x[:n]) - ca.mtimes(ca.DM(m.K2), x[:n]) - turning * ca.DM(m.V2)
    rate = ca.vertcat(x[n:], ca.mtimes(ca.DM(np.linalg.inv(m.M2)), force))
    return {"x": x, "t": t, "ode": rate}, np.append(m.tip2, np.zeros(n))


def sundials(beam: AssumedModesBeam, maneuver: SpinUp | SineTorque, timepts: Array, method: str, rtol: float) -> Array:
    """Return the tip's displacement [m] by CasADi's IDAS or CVODES."""
    import casadi as ca

    system, tip = equations(beam, maneuver)
    options = {"reltol": rtol, "abstol": 1e-2 * rtol, "max_num_steps": 10_000_000}
    flow = ca.integrator("flow", method.lower(), system, 0.0, timepts[1:], options)
    return np.concatenate([[0.0], tip @ np.array(flow(x0=0.0)["xf"])])


def scipy_motion(
    beam: AssumedModesBeam, maneuver: SpinUp | SineTorque, timepts: Array, method: str, rtol: float
) -> Array:
    """Return the tip's displacement [m] by ``solve_ivp``, the equations compiled by CasADi to one function."""
    import casadi as ca
    from scipy.integrate import solve_ivp

    system, tip = equations(beam, maneuver)
    f = ca.Function("f", [system["t"], system["x"]], [system["ode"]])
    options = {"rtol": rtol, "atol": 1e-2 * rtol}
    span, start = (0.0, timepts[-1]), np.zeros(len(tip))
    return tip @ solve_ivp(lambda t, x: np.array(f(t, x)).ravel(), span, start, method, timepts, **options).y
