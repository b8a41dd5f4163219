"""What vouches for a suspension beyond its own synthesis."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Assurance:
    exact_sigma: object
    family_sigma: tuple
    statements: dict


def assure(design, scene):
    return None
