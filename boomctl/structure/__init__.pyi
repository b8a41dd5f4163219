# The public names and where each is defined: `__init__.py` loads them from there when they are first used.

from boomctl.structure.assembly import Assembly
from boomctl.structure.beams.cross_sections import (
    CrossSection,
    bar_section,
    i_section,
    rod_section,
    round_tube_section,
    tube_section,
)
from boomctl.structure.beams.elements import DiscreteElements, FiniteElements
from boomctl.structure.displacement_input import prescribe_displacement
from boomctl.structure.families import AffineFamily, PolynomialFamily
from boomctl.structure.model import SecondOrderModel, split_symmetric
from boomctl.structure.parts import (
    GROUND,
    Beam,
    BeamSection,
    CutJoint,
    Force,
    Joint,
    Output,
    Point,
    RigidBody,
    SpringDamper,
    fixed,
    free,
    prismatic,
    revolute,
)
from boomctl.structure.response.mode_shapes import ModeShapes, ShapeLine

__all__ = [
    "GROUND",
    "AffineFamily",
    "Assembly",
    "Beam",
    "BeamSection",
    "CrossSection",
    "CutJoint",
    "DiscreteElements",
    "FiniteElements",
    "Force",
    "Joint",
    "ModeShapes",
    "Output",
    "Point",
    "PolynomialFamily",
    "RigidBody",
    "SecondOrderModel",
    "ShapeLine",
    "SpringDamper",
    "bar_section",
    "fixed",
    "free",
    "i_section",
    "prescribe_displacement",
    "prismatic",
    "revolute",
    "rod_section",
    "round_tube_section",
    "split_symmetric",
    "tube_section",
]
