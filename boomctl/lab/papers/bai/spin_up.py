"""Figs. 3 to 6 and 10 of Bai et al. (2009): prescribed spin-up, Eq. (43) with its misprint corrected, and a tip mass."""

from functools import cache

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.papers.bai.comparison import (
    MODELS,
    Comparison,
    Line,
    Panel,
    Part,
    check_statement,
    compare,
    lines,
    peak,
)
from boomctl.maneuvers import spin_up
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import SimulationResult

DURATION = 30.0  # of the spin-up [s], as printed
TIME = np.linspace(0.0, 60.0, 3001)  # [s]; the paper's figures end at 60 s
MASSES = (0.0, 0.1, 0.5)  # at the tip [kg], as in Fig. 10


@cache  # figures share runs
def _run(label: str, speed: float, modes: int, mass: float) -> SimulationResult:
    beam = hub_beam(HubBeamParameters(tip_mass=mass), MODELS[label], modes)
    return beam.simulate(spin_up(final_speed=speed, duration=DURATION), TIME)


def neglected_terms() -> Part:
    """Fig. 3: terms of CFOAM that FOAM neglects, Eqs. (35) to (39) corrected, with one mode at 3 rad/s."""
    full, first = (AssumedModesBeam(HubBeamParameters(), name, 1).equations for name in ("cfoam", "foam"))
    result = _run("CFOAM", 3.0, 1, 0.0)
    y, rate = np.split(result.states, 2, axis=1)
    inertia, plain = full.inertia(y), first.inertia(y)
    still = np.zeros_like(y)
    pull = full.residual(y, rate, still)[:, 1:] + inertia.coupling * result.hub_acceleration[:, None]
    bending = np.column_stack([np.zeros(len(y)), inertia.solve_beam(-pull)])
    rest = first.residual(y, rate, bending)[:, 1:] - full.residual(y, rate, bending)[:, 1:]
    hub = full.inertia_torque(y, rate) - first.inertia_torque(y, rate)
    v, u = (peak(row) for row in (full.tip.transverse, full.tip.axial))
    coupling = inertia.coupling - plain.coupling
    curves = (
        ("(a) inertia, Eq. (35)", r"$\Delta M_{\theta\theta}$ [$10^{-6}$ kg m$^2$]", 1e6 * (inertia.hub - plain.hub)),
        ("(b) coupling, Eq. (36)", r"$\Delta M_{q_2\theta}$ [g m]", 1e3 * coupling[:, 1] / v),
        ("(c) hub torque, Eq. (37)", r"$\Delta Q_\theta$ [$\mu$N m]", 1e6 * hub),
        ("(d) axial force, Eq. (38)", r"$\Delta Q_{q_1}$ [mN]", 1e3 * rest[:, 0] / u),
        ("(e) transverse force, Eq. (39)", r"$\Delta Q_{q_2}$ [mN]", 1e3 * rest[:, 1] / v),
        ("(f) tip displacement", "v(L) [m]", result.tip_displacement),
    )
    caption = "Fig. 3. Terms of CFOAM that FOAM neglects, spin-up to 3 rad/s, one mode (scaled to 1 at the tip)"
    panels = tuple(Panel(title, label, lines(TIME, {"": y})) for title, label, y in curves)
    ratios = [peak(y[TIME > DURATION]) / peak(y) for _, _, y in curves[:5]]
    claim = check_statement(
        "Fig. 3",
        "the neglected terms are small and tend to zero after 30 s",
        f"at most {max(ratios):.2g} of their peaks after 30 s; |ΔM_θθ| <= {1e-6 * peak(curves[0][2]):.1e} kg m²",
        max(ratios) < 0.05,
        "Eqs. (35), (36), (38), (39) corrected: the print has wrong signs and factors, and lacks terms",
        corrected=True,
    )
    return Part("Fig. 3: neglected terms", "fig-03", caption, panels, claims=(claim,))


def cfoam_and_foam() -> Part:
    """Fig. 4: CFOAM and FOAM agree at 3 rad/s; with the exact beam, which the paper has not."""
    tips = {name: _run(name, 3.0, 5, 0.0).tip_displacement for name in ("CFOAM", "FOAM", "exact")}
    differences = {name: 1e3 * (tips[name] - tips["exact"]) for name in ("CFOAM", "FOAM")}
    caption = "Fig. 4. Tip displacement of CFOAM and FOAM, spin-up to 3 rad/s, and their distances from the exact beam"
    panels = (
        Panel("(a) tip displacement", "v(L) [m]", lines(TIME, tips)),
        Panel("(b) difference from the geometrically exact beam", "Δv(L) [mm]", lines(TIME, differences)),
    )
    gap = peak(tips["CFOAM"] - tips["FOAM"]) / peak(tips["FOAM"])
    claim = check_statement(
        "Fig. 4",
        "the displacements of CFOAM and FOAM are exactly the same at 3 rad/s",
        f"largest difference {gap:.1e} of the peak",
        gap < 1e-3,
        "equal to the width of a drawn line",
    )
    return Part("Fig. 4: CFOAM and FOAM", "fig-04", caption, panels, claims=(claim,), columns=1)


def foam_and_tlam() -> Part:
    """Fig. 5: TLAM against FOAM at 2.8 and 3 rad/s, and below; transverse and axial."""
    runs = {w: {name: _run(name, w, 5, 0.0) for name in ("TLAM", "FOAM")} for w in (2.0, 2.8, 3.0)}
    panels = tuple(panel for row, (speed, pair) in enumerate(runs.items(), 1) for panel in _pair(row, speed, pair))
    far, near = (peak(r.tip_displacement) for r in runs[3.0].values())
    until = runs[3.0]["TLAM"].small_deformation_until
    claim = check_statement(
        "Fig. 5",
        "the response of TLAM diverges at 3 rad/s, that of FOAM does not",
        f"TLAM leaves L/10 at {until:.2f} s and reaches {far:.3g} m at 60 s; FOAM stays within {near:.3f} m",
        bool(far > 8.0 and until < 60.0 and near < 0.3),
        "curves of panel (a3) leave the frame: beyond small deformation they mean nothing",
    )
    caption = "Fig. 5. TLAM and FOAM: the tip during and after spin-up in 30 s"
    title = "Fig. 5: FOAM and TLAM (section 4.4 calls it Fig. 4)"
    return Part(title, "fig-05", caption, panels, _deflections(**runs[2.8]), (claim,))


def _pair(row: int, speed: float, runs: dict[str, SimulationResult]) -> tuple[Panel, Panel]:
    """Transverse and axial response at a speed; at 3 rad/s TLAM leaves the frame."""
    transverse = lines(TIME, {name: run.tip_displacement for name, run in runs.items()})
    axial = lines(TIME, {name: 1e3 * run.tip_extension for name, run in runs.items()})
    limits = ((-3.0, 1.0), (-0.02, 0.1)) if speed == 3.0 else (None, None)
    return (
        Panel(f"(a{row}) transverse, {speed} rad/s", "v(L) [m]", transverse, ylim=limits[0]),
        Panel(f"(b{row}) axial, {speed} rad/s", "w1(L) [mm]", axial, ylim=limits[1]),
    )


def _deflections(TLAM: SimulationResult, FOAM: SimulationResult) -> tuple[Comparison, ...]:
    """Largest and residual deflections at 2.8 rad/s."""
    exact = peak(_run("exact", 2.8, 5, 0.0).tip_displacement)
    tlam, foam = (peak(r.tip_displacement) for r in (TLAM, FOAM))
    rest = [peak(r.tip_displacement[TIME > DURATION]) for r in (TLAM, FOAM)]
    ratio = f"{rest[0]:.4f} m over {1e3 * rest[1]:.3f} mm; the order of magnitude holds"
    where, true = "section 4.2", f"the exact beam gives {exact:.4f}"
    return (
        compare(where, "largest tip deflection of TLAM, 2.8 rad/s", "m", 0.49, tlam),
        compare(where, "largest tip deflection of FOAM, 2.8 rad/s", "m", 0.22, foam, true),
        compare(where, "residual amplitude of TLAM over FOAM, 2.8 rad/s", "", 100.0, rest[0] / rest[1], ratio),
    )


def mode_by_mode() -> Part:
    """Fig. 6: the five modes of FOAM at 5 rad/s."""
    runs = {n: _run("FOAM", 5.0, n, 0.0) for n in (1, 2, 5)}
    tip, q = AssumedModesBeam(HubBeamParameters(), "foam", 5).equations.tip, runs[5].states[:, 1:11]
    axial, transverse = q[:, :5] * tip.axial[:5], q[:, 5:] * tip.transverse[5:]
    ratio = peak(runs[5].tip_displacement) / peak(runs[5].tip_extension)
    peaks = np.max(np.abs(transverse), axis=0)
    what = "transverse over axial peak at 5 rad/s"
    comparison = compare("Fig. 6", what, "", 1500.0, ratio, "peaks at the tip")
    claim = check_statement(
        "Fig. 6",
        "the first two transverse modes dominate",
        "peaks " + ", ".join(f"{1e3 * item:.3g}" for item in peaks) + " mm",
        bool(peaks[:2].sum() > 20.0 * peaks[2:].sum()),
        "one mode alone gives the tip to a few per cent: panel (d)",
    )
    dashes = zip(runs.items(), ("-", "--", ":"), strict=True)
    few = tuple(Line(f"{n} + {n} modes", TIME, run.tip_displacement, dash) for (n, run), dash in dashes)
    sizes = np.maximum(np.abs(transverse), 1e-9)
    panels = (
        Panel("(a) transverse modes", "share of v(L) [m]", _modes(transverse)),
        Panel("(b) axial modes", "share of w1(L) [mm]", _modes(1e3 * axial)),
        Panel(
            "(c) transverse modes, logarithmic", "|share of v(L)| [m]", _modes(sizes), logarithmic="y", ylim=(1e-7, 1.0)
        ),
        Panel("(d) number of modes", "v(L) [m]", few),
    )
    caption = "Fig. 6. FOAM, spin-up to 5 rad/s: share of each mode in the tip displacement"
    return Part("Fig. 6: modes of FOAM", "fig-06", caption, panels, (comparison,), (claim,))


def _modes(contributions: Array) -> tuple[Line, ...]:
    return lines(TIME, {f"mode {i}": contribution for i, contribution in enumerate(contributions.T, 1)})


def tip_mass() -> Part:
    """Fig. 10, at 2 rad/s: above the critical speed of TLAM with 0.5 kg, below that with 0.1 kg or none."""
    runs = {mass: {name: _run(name, 2.0, 5, mass) for name in ("TLAM", "FOAM")} for mass in MASSES}
    tips = {mass: {name: run.tip_displacement for name, run in pair.items()} for mass, pair in runs.items()}
    left = runs[0.5]["TLAM"].small_deformation_until
    relative_peak = peak(tips[0.0]["TLAM"] - tips[0.0]["FOAM"]) / peak(tips[0.0]["FOAM"])
    at_ten = {mass: _first("FOAM", mass, 10.0) for mass in MASSES}
    claims = (
        check_statement(
            "Fig. 10",
            "TLAM fails at 2 rad/s with 0.5 kg",
            f"it diverges: |v| exceeds L/10 at {left:.2f} s",
            bool(left < 60.0),
            "the critical speed is 1.936 rad/s",
        ),
        check_statement(
            "section 4.4",
            "without tip mass TLAM is almost the same as FOAM at 2 rad/s",
            f"largest difference {relative_peak:.2g} of the peak",
            relative_peak < 0.1,
            "TLAM loses stiffness with the speed squared, 47 % of it at 2 rad/s; FOAM does not",
        ),
        check_statement(
            "conclusions",
            "the tip mass has a stiffening effect in FOAM",
            "first frequency at 10 rad/s: " + ", ".join(f"{item:.3f}" for item in at_ten.values()) + " rad/s",
            at_ten[0.5] > at_ten[0.0],
            "the mass adds a stiffness term m (r_A + l) S w^2, but it lowers the frequency in FOAM too",
        ),
    )
    panels = [
        Panel(f"({letter}) tip mass {mass:g} kg", "v(L) [m]", lines(TIME, tips[mass]), ylim=limits, legend="lower left")
        for letter, mass, limits in zip("abc", MASSES, (None, None, (-3.0, 1.0)), strict=True)
    ]
    panels += [Panel("(d) first frequency", "frequency [rad/s]", _frequency_lines(), "hub speed [rad/s]")]
    caption = "Fig. 10. TLAM and FOAM with a tip mass, spin-up to 2 rad/s in 30 s; first frequency over the hub speed"
    return Part("Fig. 10: tip mass", "fig-10", caption, tuple(panels), claims=claims)


def _frequency_lines() -> tuple[Line, ...]:
    """First frequency of FOAM up to 10 rad/s, and of TLAM up to its critical speed."""
    result = []
    for label, dash in (("FOAM", "-"), ("TLAM", "--")):
        for k, mass in enumerate(MASSES):
            beam = hub_beam(HubBeamParameters(tip_mass=mass), "tlam", 15)
            end = 10.0 if label == "FOAM" else 0.999999 * float(beam.divergence_speed())
            speeds = end * np.sin(np.linspace(0.0, np.pi / 2.0, 61))
            frequencies = np.array([_first(label, mass, w) for w in speeds])
            result.append(Line(f"{label}, {mass:g} kg", speeds, frequencies, f"C{k}{dash}"))
    return tuple(result)


def _first(label: str, mass: float, speed: float) -> float:
    beam = hub_beam(HubBeamParameters(tip_mass=mass), MODELS[label], 15)
    return float(2.0 * np.pi * beam.eigenfrequencies_hz(float(speed))[0])
