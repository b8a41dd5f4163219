"""What tuning is asked to reach on the plants of COMPleib, and what was published of them."""

from dataclasses import dataclass

WITHIN = 1e-3  # share above a norm that passes for it: published values have three to five digits


@dataclass(frozen=True)
class Goal:
    """A norm wanted on a plant with a controller of some order.

    Attributes
    ----------
    plant : str
        In COMPleib.
    order : int
        Of the controller; 0: a gain.
    norm : float or None
        What is asked for; None where only the certificate is.
    within : float
        Share above it that passes.
    published : float or None
        The lowest norm known to be published for the same plant and order, where ``norm`` is not that.
    """

    plant: str
    order: int = 0
    norm: float | None = None
    within: float = WITHIN
    published: float | None = None

    @property
    def limit(self) -> float | None:
        """The highest norm that passes; without a norm asked for, one near that published."""
        if self.norm is None:
            return None if self.published is None else self.published * (1.0 + WITHIN)
        return self.norm * (1.0 + self.within)

    @property
    def name(self) -> str:
        """Plant and order."""
        return self.plant + (f", order {self.order}" if self.order else ", a gain")


GOALS = (
    Goal("HE1", 0, 0.1539),
    Goal("HE1", 2, 0.1166, within=0.0),
    Goal("REA2", 0, 1.149),
    Goal("REA2", 1, 1.1341, within=0.0),
    Goal("AC8", 0, 2.0051),
    Goal("AC8", 1, 1.768, within=0.0),
    Goal("AC4", 1, 0.5589, within=0.0),
    Goal("AC15", 0, 15.19),
    Goal("DIS1", 0, 4.166),
    Goal("TG1", 0, 12.847),
    Goal("HE4", 0, 23.0, within=0.0, published=22.838),
    Goal("WEC1", 0, None, published=4.05),
    Goal("HF1", 0, 0.44722),
    Goal("CM3", 0, 0.81650),
    Goal("BDT2", 0, 0.6848),
    Goal("AC10", 0, 13.24, within=0.0),
    Goal("AC10", 1, None, published=10.21),
)
"""What is measured against a number; all other plants are asked for a certified norm."""
