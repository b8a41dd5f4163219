"""Numbers printed in the papers."""

TABLE_1 = {
    "measured": (0.34, 0.59, 0.88, 2.8, 4.2),
    "finite": (0.2450, 0.5869, 0.9352, 2.7874, 4.0393),
    "discrete-hermite": (0.2442, 0.5866, 0.9326, 2.7984, 4.0501),
    "discrete-geometric": (0.2436, 0.5814, 0.9305, 2.9316, 3.9881),
}
"""Anthonis & Ramon (2003), Table 1: natural frequencies of the boom, platform held by its actuators [Hz]."""

TABLE_1_ELEMENTS = {"finite": 6, "discrete-hermite": 6, "discrete-geometric": 20}
"""The number of elements behind each column of Table 1."""

TABLE_2 = {
    "platform_mass": 250.0,
    "cradle_mass": 50.0,
    "boom_mass": 35.76,
    "platform_inertia": 250.0,
    "cradle_inertia": 50.0,
    "boom_inertia": 361.38,
    "density": 7800.0,
    "youngs_modulus": 1.8e11,
    "length": 12.0,
    "actuator_distance": 1.78,
    "spring_distance": 1.318,
    "outer_width": 0.02,
    "inner_width": 0.0158,
    "outer_height": 0.0603,
    "inner_height": 0.056,
    "spring_stiffness": 1100.0,
    "cradle_damping": 160.0,
    "hinge_damping": 2.0,
    "structural_damping": 1e-4,
}
"""Anthonis & Ramon (2003), Table 2, SI units."""
