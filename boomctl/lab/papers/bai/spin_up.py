"""Figs. 3 to 6 and 10 of Bai et al. (2009): prescribed spin-up, Eq. (43) with its print mended, and a tip mass."""

from functools import cache

import numpy as np

from boomctl.arrays import Array
from boomctl.lab.papers.bai.comparison import MODEL_COLOURS, Chart, Comparison, Line, Panel, Part, compare, judge, peak
from boomctl.rotating_beam.assumed_modes import AssumedModesBeam
from boomctl.rotating_beam.factory import hub_beam
from boomctl.rotating_beam.manoeuvres import spin_up
from boomctl.rotating_beam.parameters import HubBeamParameters
from boomctl.rotating_beam.result import SimulationResult

DURATION = 30.0  # of the spin-up [s], as printed
TIME = np.linspace(0.0, 60.0, 3001)  # [s]; the paper's figures end at 60 s
MASSES = (0.0, 0.1, 0.5)  # at the tip [kg], as in Fig. 10
APPROXIMATE = 0.1
"""Share by which a number that the paper calls approximate may differ."""


def _run(model: str, speed: float, modes: int = 5, mass: float = 0.0) -> SimulationResult:
    return _spun_up(model, speed, modes, mass)


@cache  # figures share runs
def _spun_up(model: str, speed: float, modes: int, mass: float) -> SimulationResult:
    beam = hub_beam(HubBeamParameters(tip_mass=mass), model, modes)
    return beam.simulate(spin_up(final_speed=speed, duration=DURATION), TIME)


def neglected_terms() -> Part:
    """Fig. 3: what FOAM neglects of CFOAM, Eqs. (35) to (39) mended, with one mode at 3 rad/s."""
    full, first = (AssumedModesBeam(HubBeamParameters(), name, 1).equations for name in ("cfoam", "foam"))
    result = _run("cfoam", 3.0, modes=1)
    y, rate = np.split(result.states, 2, axis=1)
    inertia, plain = full.inertia(y), first.inertia(y)
    still = np.zeros_like(y)
    pull = full.residual(y, rate, still)[:, 1:] + inertia.coupling * result.hub_acceleration[:, None]
    bending = np.column_stack([np.zeros(len(y)), inertia.solve_beam(-pull)])
    rest = first.residual(y, rate, bending)[:, 1:] - full.residual(y, rate, bending)[:, 1:]
    hub = full.inertia_torque(y, rate) - first.inertia_torque(y, rate)
    v, u = (peak(row) for row in (full.tip.transverse, full.tip.axial))
    curves = (
        ("(a) inertia, Eq. (35)", r"$\Delta M_{\theta\theta}$ [$10^{-6}$ kg m$^2$]", 1e6 * (inertia.hub - plain.hub)),
        (
            "(b) coupling, Eq. (36)",
            r"$\Delta M_{q_2\theta}$ [g m]",
            1e3 * (inertia.coupling - plain.coupling)[:, 1] / v,
        ),
        ("(c) hub torque, Eq. (37)", r"$\Delta Q_\theta$ [$\mu$N m]", 1e6 * hub),
        ("(d) axial force, Eq. (38)", r"$\Delta Q_{q_1}$ [mN]", 1e3 * rest[:, 0] / u),
        ("(e) transverse force, Eq. (39)", r"$\Delta Q_{q_2}$ [mN]", 1e3 * rest[:, 1] / v),
        ("(f) tip displacement", "v(L) [m]", result.tip_displacement),
    )
    panels = tuple(Panel(title, label, (Line("", TIME, y),)) for title, label, y in curves)
    chart = Chart(
        "fig-03",
        "Fig. 3. Terms of CFOAM that FOAM neglects, spin-up to 3 rad/s, one mode (scaled to 1 at the tip)",
        panels,
        columns=2,
    )
    late = TIME > DURATION
    shares = [peak(y[late]) / peak(y) for _, _, y in curves[:5]]
    claim = judge(
        "Fig. 3",
        "the neglected terms are small and tend to zero after 30 s",
        f"at most {max(shares):.2g} of their peaks after 30 s; |ΔM_θθ| <= {1e-6 * peak(curves[0][2]):.1e} kg m²",
        max(shares) < 0.05,
        "Eqs. (35), (36), (38), (39) as mended: the print has wrong signs and factors, and misses terms",
        corrected=True,
    )
    return Part("Fig. 3: neglected terms", (chart,), claims=(claim,))


def cfoam_and_foam() -> Part:
    """Fig. 4: CFOAM and FOAM agree at 3 rad/s; with the exact beam, which the paper has not."""
    models = {"CFOAM": "cfoam", "FOAM": "foam", "exact": "geometrically-exact"}
    tips = {name: _run(model, 3.0).tip_displacement for name, model in models.items()}
    differences = {name: 1e3 * (tips[name] - tips["exact"]) for name in ("CFOAM", "FOAM")}
    chart = Chart(
        "fig-04",
        "Fig. 4. Tip displacement of CFOAM and FOAM, spin-up to 3 rad/s, and their distances from the exact beam",
        (
            Panel("(a) tip displacement", "v(L) [m]", _lines(tips)),
            Panel("(b) difference from the geometrically exact beam", "Δv(L) [mm]", _lines(differences)),
        ),
    )
    gap = peak(tips["CFOAM"] - tips["FOAM"]) / peak(tips["FOAM"])
    claim = judge(
        "Fig. 4",
        "the displacements of CFOAM and FOAM are exactly the same at 3 rad/s",
        f"largest difference {gap:.1e} of the peak",
        gap < 1e-3,
        "equal to the width of a drawn line",
    )
    return Part("Fig. 4: CFOAM and FOAM", (chart,), claims=(claim,))


def foam_and_tlam() -> Part:
    """Fig. 5: TLAM against FOAM at 2.8 and 3 rad/s, and below; transverse and axial."""
    foam, tlam = ({w: _run(model, w) for w in (2.0, 2.8, 3.0)} for model in ("foam", "tlam"))
    panels = tuple(panel for i, w in enumerate(foam) for panel in _pair(i + 1, w, tlam[w], foam[w]))
    chart = Chart("fig-05", "Fig. 5. TLAM and FOAM: the tip during and after spin-up in 30 s", panels, columns=2)
    until, far, near = tlam[3.0].small_deformation_until, *(peak(r[3.0].tip_displacement) for r in (tlam, foam))
    claim = judge(
        "Fig. 5",
        "the response of TLAM diverges at 3 rad/s, that of FOAM does not",
        f"TLAM leaves L/10 at {until:.2f} s and reaches {far:.3g} m at 60 s; FOAM stays within {near:.3f} m",
        bool(far > 8.0 and until < 60.0 and near < 0.3),
        "curves of panel (a3) leave the frame: beyond small deformation they mean nothing",
    )
    title = "Fig. 5: FOAM and TLAM (section 4.4 calls it Fig. 4)"
    return Part(title, (chart,), _deflections(tlam[2.8], foam[2.8]), (claim,))


def _pair(row: int, speed: float, tlam: SimulationResult, foam: SimulationResult) -> tuple[Panel, Panel]:
    """Transverse and axial response at a speed; at 3 rad/s TLAM leaves the frame."""
    diverging = speed == 3.0
    transverse = _lines({"TLAM": tlam.tip_displacement, "FOAM": foam.tip_displacement})
    axial = _lines({"TLAM": 1e3 * tlam.axial_tip_displacement, "FOAM": 1e3 * foam.axial_tip_displacement})
    limits = ((-3.0, 1.0), (-0.02, 0.1)) if diverging else (None, None)
    return (
        Panel(f"(a{row}) transverse, {speed} rad/s", "v(L) [m]", transverse, ylim=limits[0]),
        Panel(f"(b{row}) axial, {speed} rad/s", "w1(L) [mm]", axial, ylim=limits[1]),
    )


def _deflections(tlam: SimulationResult, foam: SimulationResult) -> tuple[Comparison, ...]:
    """Largest and residual deflections at 2.8 rad/s."""
    exact = peak(_run("geometrically-exact", 2.8).tip_displacement)
    rest = [peak(r.tip_displacement[TIME > DURATION]) for r in (tlam, foam)]
    rows = (
        ("largest tip deflection of TLAM, 2.8 rad/s", "m", 0.49, peak(tlam.tip_displacement), ""),
        (
            "largest tip deflection of FOAM, 2.8 rad/s",
            "m",
            0.22,
            peak(foam.tip_displacement),
            f"the exact beam gives {exact:.4f}",
        ),
        (
            "residual amplitude of TLAM over FOAM, 2.8 rad/s",
            "",
            100.0,
            rest[0] / rest[1],
            f"{rest[0]:.4f} m over {1e3 * rest[1]:.3f} mm; the order of magnitude holds",
        ),
    )
    return tuple(
        compare("section 4.2", what, unit, published=printed, computed=ours, tolerance=APPROXIMATE * printed, why=why)
        for what, unit, printed, ours, why in rows
    )


def mode_by_mode() -> Part:
    """Fig. 6: the five modes of FOAM at 5 rad/s."""
    result = _run("foam", 5.0)
    tip = AssumedModesBeam(HubBeamParameters(), "foam", 5).equations.tip
    q = result.states[:, 1:11]
    axial, transverse = q[:, :5] * tip.axial[:5], q[:, 5:] * tip.transverse[5:]
    ratio = peak(result.tip_displacement) / peak(result.axial_tip_displacement)
    peaks = np.max(np.abs(transverse), axis=0)
    comparison = compare(
        "Fig. 6",
        "transverse over axial peak at 5 rad/s",
        "",
        published=1500.0,
        computed=ratio,
        tolerance=APPROXIMATE * 1500.0,
        why="peaks at the tip",
    )
    claim = judge(
        "Fig. 6",
        "the first two transverse modes dominate",
        "peaks " + ", ".join(f"{1e3 * each:.3g}" for each in peaks) + " mm",
        bool(peaks[:2].sum() > 20.0 * peaks[2:].sum()),
        "one mode alone gives the tip to a few per cent: panel (d)",
    )
    return Part("Fig. 6: modes of FOAM", (_fig_6(axial, transverse),), (comparison,), (claim,))


def _fig_6(axial: Array, transverse: Array) -> Chart:
    few = tuple(
        Line(f"{n} + {n} modes", TIME, _run("foam", 5.0, modes=n).tip_displacement, style)
        for n, style in ((1, "-"), (2, "--"), (5, ":"))
    )
    sizes = _modes(np.maximum(np.abs(transverse), 1e-9))
    return Chart(
        "fig-06",
        "Fig. 6. FOAM, spin-up to 5 rad/s: share of each mode in the tip displacement",
        (
            Panel("(a) transverse modes", "share of v(L) [m]", _modes(transverse)),
            Panel("(b) axial modes", "share of w1(L) [mm]", _modes(1e3 * axial)),
            Panel("(c) transverse modes, logarithmic", "|share of v(L)| [m]", sizes, logarithmic="y", ylim=(1e-7, 1.0)),
            Panel("(d) number of modes", "v(L) [m]", few),
        ),
        columns=2,
    )


def tip_mass() -> Part:
    """Fig. 10, at 2 rad/s: above the critical speed of TLAM with 0.5 kg, below that with 0.1 kg or none."""
    tlam, foam = ({mass: _run(model, 2.0, mass=mass) for mass in MASSES} for model in ("tlam", "foam"))
    left = tlam[0.5].small_deformation_until
    share = peak(tlam[0.0].tip_displacement - foam[0.0].tip_displacement) / peak(foam[0.0].tip_displacement)
    at_ten = {mass: _first("foam", mass, 10.0) for mass in MASSES}
    claims = (
        judge(
            "Fig. 10",
            "TLAM fails at 2 rad/s with 0.5 kg",
            f"it diverges: |v| exceeds L/10 at {left:.2f} s",
            bool(left < 60.0),
            "the critical speed is 1.936 rad/s",
        ),
        judge(
            "section 4.4",
            "without tip mass TLAM is almost the same as FOAM at 2 rad/s",
            f"largest difference {share:.2g} of the peak",
            share < 0.1,
            "TLAM loses stiffness with the speed squared, 47 % of it at 2 rad/s; FOAM does not",
        ),
        judge(
            "conclusions",
            "the tip mass has a stiffening effect in FOAM",
            "first frequency at 10 rad/s: " + ", ".join(f"{each:.3f}" for each in at_ten.values()) + " rad/s",
            at_ten[0.5] > at_ten[0.0],
            "the mass adds a stiffness term m (r_A + l) S w^2, but it lowers the frequency in FOAM too",
        ),
    )
    return Part("Fig. 10: tip mass", (_fig_10(tlam, foam),), claims=claims)


def _fig_10(tlam: dict[float, SimulationResult], foam: dict[float, SimulationResult]) -> Chart:
    panels = tuple(
        Panel(
            f"({letter}) tip mass {mass:g} kg",
            "v(L) [m]",
            _lines({"TLAM": tlam[mass].tip_displacement, "FOAM": foam[mass].tip_displacement}),
            ylim=(-3.0, 1.0) if mass == 0.5 else None,
            legend="lower left",
        )
        for letter, mass in zip("abc", MASSES, strict=True)
    )
    frequencies = Panel("(d) first frequency", "frequency [rad/s]", _frequency_lines(), "hub speed [rad/s]")
    return Chart(
        "fig-10",
        "Fig. 10. TLAM and FOAM with a tip mass, spin-up to 2 rad/s in 30 s; first frequency over the hub speed",
        (*panels, frequencies),
        columns=2,
    )


def _frequency_lines() -> tuple[Line, ...]:
    """First frequency of FOAM up to 10 rad/s, and of TLAM up to its critical speed."""
    lines = []
    for model, style in (("foam", "-"), ("tlam", "--")):
        for mass, colour in zip(MASSES, ("#0072b2", "#d55e00", "#009e73"), strict=True):
            end = 10.0 if model == "foam" else 0.999999 * _critical(mass)
            speeds = end * np.sin(np.linspace(0.0, np.pi / 2.0, 61))
            label = f"{model.upper()}, {mass:g} kg"
            lines.append(Line(label, speeds, np.array([_first(model, mass, w) for w in speeds]), style, colour))
    return tuple(lines)


def _first(model: str, mass: float, speed: float) -> float:
    return float(2.0 * np.pi * hub_beam(HubBeamParameters(tip_mass=mass), model, 15).frequencies_hz(float(speed))[0])


def _critical(mass: float) -> float:
    return float(hub_beam(HubBeamParameters(tip_mass=mass), "tlam", 15).critical_speed())


def _modes(shares: Array) -> tuple[Line, ...]:
    return tuple(Line(f"mode {i + 1}", TIME, shares[:, i]) for i in range(shares.shape[1]))


def _lines(curves: dict[str, Array]) -> tuple[Line, ...]:
    styles = {"FOAM": "--", "exact": ":"}
    return tuple(Line(name, TIME, y, styles.get(name, "-"), MODEL_COLOURS[name]) for name, y in curves.items())
