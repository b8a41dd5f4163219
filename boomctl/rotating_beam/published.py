"""Numbers printed in Bai et al. (2009), Sensors & Transducers 5, 53-68; its Table 1 is ``HubBeamParameters()``."""

FREQUENCIES_HZ = {
    ("foam", 0.0): (0.4635, 2.9047, 8.1332, 15.9377, 26.3462),
    ("tlam", 1.0): (0.4353, 2.9003, 8.1316, 15.9369, 26.3457),
    ("foam", 1.0): (0.4714, 2.9308, 8.1618, 15.9682, 26.3776),
}
"""Table 2, under the caption of Table 3: frequencies [Hz] by model and hub speed [rad/s]; at rest those of any model."""

CRITICAL_SPEEDS = {0.0: 2.91, 0.1: 2.60, 0.5: 1.91}
"""Section 4.4: critical speeds of TLAM [rad/s] by tip mass [kg]."""

INERTIA_TORQUES = {50.0: 6.24e-3, 100.0: 4.61e-2, 200.0: 3.72e-2, 400.0: 2.62}
"""Table 3, under the caption of Table 2: largest Q_theta [N m] by the amplitude of the sine torque [N m]."""
