"""What Anthonis & Ramon (2003) published of the boom."""

MEASURED_HZ = (0.34, 0.59, 0.88, 2.8, 4.2)
"""Table 1, measured eigenfrequencies."""

TABLE_1 = {
    "finite elements, 6": (0.2450, 0.5869, 0.9352, 2.7874, 4.0393),
    "discrete elements, Hermitian mass, 6": (0.2442, 0.5866, 0.9326, 2.7984, 4.0501),
    "discrete elements, geometrical mass, 20": (0.2436, 0.5814, 0.9305, 2.9316, 3.9881),
}
"""Table 1, computed eigenfrequencies [Hz], one method a line."""
