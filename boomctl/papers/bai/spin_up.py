"""Figs. 3 to 6 of Bai et al. (2009): prescribed spin-up, Eq. (43) with its print mended."""

import numpy as np

from boomctl.arrays import Array
from boomctl.papers.bai.comparison import Comparison, Part, compare, judge
from boomctl.plotting.rotating_beam import COLOURS, Chart, Line, Panel
from boomctl.rotating_beam import HubBeam, HubBeamParameters, SimulationResult, hub_beam, spin_up

DURATION = 30.0
TIME = np.linspace(0.0, 60.0, 3001)
APPROXIMATE = 0.1
"""Share by which a number that the paper calls approximate may differ."""


def _run(model: str, speed: float, modes: int = 5) -> SimulationResult:
    beam = hub_beam(HubBeamParameters(), model, modes)
    return beam.simulate(spin_up(final_speed=speed, duration=DURATION), TIME)


def neglected_terms() -> Part:
    """Fig. 3: what FOAM neglects of CFOAM, Eqs. (35) to (39) mended, with one mode at 3 rad/s."""
    full, first = (HubBeam(HubBeamParameters(), name, 1).equations for name in ("cfoam", "foam"))
    result = _run("cfoam", 3.0, modes=1)
    y, rate = np.split(result.states, 2, axis=1)
    inertia, plain = full.inertia(y), first.inertia(y)
    still = np.zeros_like(y)
    pull = full.residual(y, rate, still)[:, 1:] + inertia.coupling * result.hub_acceleration[:, None]
    bending = np.column_stack([np.zeros(len(y)), inertia.solve_beam(-pull)])
    rest = first.residual(y, rate, bending)[:, 1:] - full.residual(y, rate, bending)[:, 1:]
    hub = full.inertia_torque(y, rate) - first.inertia_torque(y, rate)
    v, u = (_peak(row) for row in (full.tip.transverse, full.tip.axial))
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
    panels = tuple(Panel(title, "time [s]", label, (Line("", TIME, y),)) for title, label, y in curves)
    chart = Chart(
        "fig-03",
        "Fig. 3. Terms of CFOAM that FOAM neglects, spin-up to 3 rad/s, one mode (scaled to 1 at the tip)",
        panels,
        columns=2,
    )
    late = TIME > DURATION
    shares = [float(np.max(np.abs(y[late])) / np.max(np.abs(y))) for _, _, y in curves[:5]]
    claim = judge(
        "Fig. 3",
        "the neglected terms are small and tend to zero after 30 s",
        f"at most {max(shares):.2g} of their peaks after 30 s; |ΔM_θθ| <= {1e-6 * _peak(curves[0][2]):.1e} kg m²",
        max(shares) < 0.05,
        "Eqs. (35), (36), (38), (39) as mended: the print has wrong signs and factors, and lacks terms",
        corrected=True,
    )
    return Part("Fig. 3: neglected terms", (chart,), claims=(claim,))


def cfoam_and_foam() -> Part:
    """Fig. 4: CFOAM and FOAM agree at 3 rad/s; with the exact beam, which the paper has not."""
    runs = {"CFOAM": _run("cfoam", 3.0), "FOAM": _run("foam", 3.0), "exact": _run("geometrically-exact", 3.0)}
    chart = Chart(
        "fig-04",
        "Fig. 4. Tip displacement of CFOAM and FOAM, spin-up to 3 rad/s, and their distances from the exact beam",
        (
            Panel("(a) tip displacement", "time [s]", "v(L) [m]", _lines(runs)),
            Panel(
                "(b) difference from the geometrically exact beam",
                "time [s]",
                "Δv(L) [mm]",
                tuple(
                    Line(
                        name,
                        TIME,
                        1e3 * (runs[name].tip_displacement - runs["exact"].tip_displacement),
                        style,
                        COLOURS[name],
                    )
                    for name, style in (("CFOAM", "-"), ("FOAM", "--"))
                ),
            ),
        ),
    )
    gap = _peak(runs["CFOAM"].tip_displacement - runs["FOAM"].tip_displacement) / _peak(runs["FOAM"].tip_displacement)
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
    until, far, near = tlam[3.0].small_deformation_until, *(_peak(r[3.0].tip_displacement) for r in (tlam, foam))
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
    axial = tuple(
        Line(name, TIME, 1e3 * r.axial_tip_displacement, style, COLOURS[name])
        for name, r, style in (("TLAM", tlam, "-"), ("FOAM", foam, "--"))
    )
    return (
        Panel(
            f"(a{row}) transverse, {speed} rad/s",
            "time [s]",
            "v(L) [m]",
            _lines({"TLAM": tlam, "FOAM": foam}),
            ylim=(-3.0, 1.0) if diverging else None,
        ),
        Panel(
            f"(b{row}) axial, {speed} rad/s",
            "time [s]",
            "w1(L) [mm]",
            axial,
            ylim=(-0.02, 0.1) if diverging else None,
        ),
    )


def _deflections(tlam: SimulationResult, foam: SimulationResult) -> tuple[Comparison, ...]:
    """Largest and residual deflections at 2.8 rad/s."""
    exact = _peak(_run("geometrically-exact", 2.8).tip_displacement)
    rest = [_peak(r.tip_displacement[TIME > DURATION]) for r in (tlam, foam)]
    rows = (
        ("largest tip deflection of TLAM, 2.8 rad/s", "m", 0.49, _peak(tlam.tip_displacement), ""),
        (
            "largest tip deflection of FOAM, 2.8 rad/s",
            "m",
            0.22,
            _peak(foam.tip_displacement),
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
        compare("section 4.2", what, unit, printed, ours, APPROXIMATE * printed, why)
        for what, unit, printed, ours, why in rows
    )


def mode_by_mode() -> Part:
    """Fig. 6: the five modes of FOAM at 5 rad/s."""
    result = _run("foam", 5.0)
    tip = HubBeam(HubBeamParameters(), "foam", 5).equations.tip
    q = result.states[:, 1:11]
    axial, transverse = q[:, :5] * tip.axial[:5], q[:, 5:] * tip.transverse[5:]
    ratio = _peak(result.tip_displacement) / _peak(result.axial_tip_displacement)
    peaks = np.max(np.abs(transverse), axis=0)
    comparison = compare(
        "Fig. 6", "transverse over axial peak at 5 rad/s", "", 1500.0, ratio, APPROXIMATE * 1500.0, "peaks at the tip"
    )
    claim = judge(
        "Fig. 6",
        "the first two transverse modes dominate",
        "peaks " + ", ".join(f"{1e3 * peak:.3g}" for peak in peaks) + " mm",
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
            Panel("(a) transverse modes", "time [s]", "share of v(L) [m]", _modes(transverse)),
            Panel("(b) axial modes", "time [s]", "share of w1(L) [mm]", _modes(1e3 * axial)),
            Panel("(c) transverse modes, logarithmic", "time [s]", "|share of v(L)| [m]", sizes, "y", (1e-7, 1.0)),
            Panel("(d) number of modes", "time [s]", "v(L) [m]", few),
        ),
        columns=2,
    )


def _modes(shares: Array) -> tuple[Line, ...]:
    return tuple(Line(f"mode {i + 1}", TIME, shares[:, i]) for i in range(shares.shape[1]))


def _lines(runs: dict[str, SimulationResult]) -> tuple[Line, ...]:
    styles = {"FOAM": "--", "exact": ":"}
    return tuple(
        Line(name, r.time, r.tip_displacement, styles.get(name, "-"), COLOURS[name]) for name, r in runs.items()
    )


def _peak(values: Array) -> float:
    return float(np.max(np.abs(values)))
