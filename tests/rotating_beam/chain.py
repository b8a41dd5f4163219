"""A chain of rigid links instead of a beam: own equations, own integrator, for motions of any size."""

import numpy as np
from scipy.integrate import solve_ivp


def chain_tip(p, motion, times, links):
    """Return where the free end is across the hub, its motion prescribed; inextensible, of second order in the links.

    Masses stand at the joints, half a link's at the free end; springs bend between links, the first to the clamp with half
    a link. Unknowns are the links' angles against the hub, and their rates in fixed axes.
    """
    length = p.length / links
    masses = np.full(links, p.mass_per_length * length)
    masses[-1] = 0.5 * masses[-1] + p.tip_mass
    beyond = np.cumsum(masses[::-1])[::-1]
    kernel, hub = length**2 * np.minimum.outer(beyond, beyond), p.hub_radius * length * beyond
    springs = np.full(links, p.bending_stiffness / length)
    springs[0] *= 2.0
    bending = np.diag(springs + np.append(springs[1:], 0.0)) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)

    def rate(t, y):
        bent, turning = y[:links], y[links:]
        speed, acceleration = float(motion.speed(t)), float(motion.acceleration(t))
        apart = bent[:, None] - bent
        force = -(kernel * np.sin(apart)) @ turning**2 - bending @ bent
        force -= hub * (np.cos(bent) * acceleration + np.sin(bent) * speed**2)
        return np.concatenate([turning - speed, np.linalg.solve(kernel * np.cos(apart), force)])

    start = np.concatenate([np.zeros(links), np.full(links, float(motion.speed(0.0)))])
    found = solve_ivp(rate, (0.0, times[-1]), start, method="Radau", t_eval=times, rtol=1e-6, atol=1e-7)
    return length * np.sin(found.y[:links]).sum(axis=0)
