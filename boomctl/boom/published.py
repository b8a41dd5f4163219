"""Numbers printed in Anthonis & Ramon (2003), J. Sound Vib. 266, 535-552; its Table 2 is ``BoomParameters()``.

The measured curve of its Fig. 3 is not available in numbers; the frequencies of its peaks are.
"""

MEASURED_HZ = (0.34, 0.59, 0.88, 2.8, 4.2)
"""Table 1: natural frequencies measured on the boom, the platform held by its actuators [Hz]."""

COMPUTED_HZ = {
    ("finite", 6): (0.2450, 0.5869, 0.9352, 2.7874, 4.0393),
    ("discrete-hermite", 6): (0.2442, 0.5866, 0.9326, 2.7984, 4.0501),
    ("discrete-geometric", 20): (0.2436, 0.5814, 0.9305, 2.9316, 3.9881),
}
"""Table 1: the computed ones [Hz], by discretization and number of elements, as ``spray_boom`` takes them."""
