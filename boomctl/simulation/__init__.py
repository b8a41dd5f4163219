"""Linear plants in time: sampled controllers, limits, end stops, Coulomb friction."""

from boomctl.simulation.friction import CoulombFriction
from boomctl.simulation.loop import simulate_loop
from boomctl.simulation.result import FrictionReport, LoopResult
from boomctl.simulation.stops import StopHit

__all__ = ["CoulombFriction", "FrictionReport", "LoopResult", "StopHit", "simulate_loop"]
