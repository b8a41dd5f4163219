"""A loop around a hub-beam by brute force: SciPy's integrator, restarted wherever anything changes."""

import numpy as np
from scipy.integrate import solve_ivp

from boomctl.rotating_beam.sensors import LOOP_INPUTS

_SAME = 1e-12  # s: events this near to each other are one


def accelerations(beam, y, rate, forces):
    """Accelerations of the coordinates under (torque, disturbance torque, tip force), from the numerical equations."""
    e = beam.equations
    q, reach = y[1:], beam.parameters.hub_radius + beam.parameters.length
    along = reach + e.tip.axial @ q - 0.5 * q @ e.tip.shortening @ q
    given = np.concatenate([[forces[0] + forces[1] + along * forces[2]], forces[2] * e.tip.transverse])
    parts = e.inertia(y[None])
    size = len(y)
    M = np.zeros((size, size))
    M[0, 0], M[0, 1:], M[1:, 0] = parts.hub[0], parts.coupling[0], parts.coupling[0]
    M[1:, 1:] = parts.beam if parts.beam.ndim == 2 else parts.beam[0]
    return np.linalg.solve(M, given - e.residual(y[None], rate[None], np.zeros((1, size)))[0])


ATOL = 1e-14  # [m, rad, ...] to which the reference is solved where a state is nearly zero


def brute_force(beam, law, disturbance, time, *, sample_time, read, start=None, **options):
    """States at the times, and what the controller was given at each sample.

    ``law`` is ``(A, B, C, D, L)``, or a function from what is measured to that; ``read`` maps state, accelerations and
    forces to what the controller measures.
    """
    delay, force = options.get("delay", 0.0), options.get("force", np.inf)
    rate, quantum = options.get("rate", np.inf) * sample_time, options.get("quantum")
    noise, reference, forward = options.get("noise"), options.get("reference"), options.get("forward")
    changing = law if callable(law) else lambda measured: law
    size = len(beam.state_labels) // 2
    end = time[-1]
    rows = np.array([disturbance.get(name, 0.0 * time) for name in LOOP_INPUTS])

    def forces(t, control):
        found = np.array([np.interp(t, time, row) for row in rows])
        found[0] += control
        return found

    samples = sample_time * np.arange(int(np.floor((end - time[0]) / sample_time + 1e-6)) + 1) + time[0]
    arrivals = samples + delay
    events = np.concatenate([time, samples, arrivals[arrivals <= end]])
    events = np.sort(events)
    events = events[np.append(True, np.diff(events) > _SAME)]
    x = np.zeros(2 * size) if start is None else np.array(start, dtype=float)
    state, last, given, control, states, k, come = None, 0.0, [], 0.0, [], 0, 0
    for number, t in enumerate(events):
        if k < len(samples) and abs(samples[k] - t) <= _SAME:
            f = forces(t, control)
            y = np.array(read(x, accelerations(beam, x[:size], x[size:], f)))
            y = y if noise is None else y + noise[k]
            y = y if quantum is None else quantum * np.rint(y / quantum)
            A, B, C, D, L = changing(y)
            state = np.zeros(len(A)) if state is None else state
            y = y if reference is None else y - np.array([np.interp(t, time, row) for row in reference])
            asked = float(C @ state + D @ y) + (0.0 if forward is None else np.interp(t, time, forward))
            allowed = float(np.clip(asked, -force, force))
            allowed = last + float(np.clip(allowed - last, -rate, rate)) if abs(allowed - last) > rate else allowed
            state = A @ state + B @ y + L * (allowed - asked)
            last = allowed
            given.append(allowed)
            k += 1
        if come < len(arrivals) and abs(arrivals[come] - t) <= _SAME:
            control, come = given[come], come + 1
        states.append(x)
        if number == len(events) - 1:
            break

        def derivative(s, x, control=control):
            return np.concatenate([x[size:], accelerations(beam, x[:size], x[size:], forces(s, control))])

        x = solve_ivp(derivative, (t, events[number + 1]), x, "DOP853", rtol=1e-12, atol=ATOL).y[:, -1]
    places = [int(np.abs(events - t).argmin()) for t in time]
    return np.array(states)[places], np.array(given)
