"""Numbers that the hub-beam has to meet: converged, computed independently, or published by others."""

CLAMPED_HZ = (0.46325907, 2.90319507, 8.12903025, 15.92965488, 26.33286092)
"""Table 2 of Bai et al. (2009), first row, by exact theory: the print is 1.000507 times this, as if 2 pi were 6.28."""

FOAM_HZ_AT_1 = (0.47111124, 2.92933462, 8.15767075, 15.96005008, 26.36424078)
"""Table 2, last row, likewise: eigenvalues of K2 + w^2 (D - M2) at 1 rad/s, converged in the number of modes."""

FOAM_HZ_AT_1_COUPLED = 0.47111033
"""The first of them with axial modes and gyroscopic terms."""

PUBLISHED_OVER_EXACT = 1.000507

TLAM_CRITICAL_SPEED = {0.0: 2.910743, 0.1: 2.604292, 0.5: 1.936453}
"""rad/s, by tip mass [kg]."""

FOAM_LOWEST_AT_10 = {0.0: 5.451, 0.1: 5.171, 0.5: 4.547}
"""rad/s at a hub speed of 10 rad/s, by tip mass [kg]."""

SPIN_UP_PEAK = {"tlam": 0.4792, "foam": 0.2044}
"""Largest tip deflection [m] for 2.8 rad/s in 30 s."""

INERTIA_TORQUE_PEAK = {50.0: 6.42e-3, 100.0: 4.93e-2, 200.0: 3.40e-1, 400.0: 1.954}
"""Largest |Q_theta| [N m] of FOAM with 5 + 5 modes under the sine torque of amplitude [N m]."""

RESIDUAL_AT_400 = {"foam": 0.490, "cfoam": 0.671}
"""Largest tip deflection [m] for 10 s < t <= 30 s after 400 N m."""

WRIGHT_FLAPWISE = {
    0.0: (3.5160, 22.0345, 61.6972),
    2.0: (4.1373, 22.6149, 62.2732),
    6.0: (7.3604, 26.8091, 66.6839),
    12.0: (13.1702, 37.6031, 79.6145),
}
"""Wright et al. (1982): flapwise frequencies of a rotating cantilever, made dimensionless, by dimensionless speed."""
