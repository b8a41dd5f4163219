# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # 8. From data to a controller
#
# A motor turns a steel ruler. There is a drawing, and one minute of measurement: the motor was shaken, an encoder and a
# strain gauge were read 250 times a second. Nobody knows how strong the amplifier really is, what friction there is, how
# stiff the ruler is, or how it is damped.
#
# Here the rig is simulated, so that the truth is known. It is used twice: to make the record, and at the end, to see
# whether the controller does on the true rig what was promised. `boomctl design measured_hub` reports the same.

# %%
import tempfile
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import boomctl as bc
from boomctl import tunable
from boomctl.structure import SecondOrderModel

plt.style.use("boomctl.plotting.look")  # or a style of your own

# %% [markdown]
# ## A model with unknown parameters
#
# Hub and ruler are as drawn. Friction acts at the hub, and the torque asked for comes out larger or smaller by the gain
# of the amplifier. Any machine of your own can stand here: a function of parameters that returns a structure.

# %%
drawn = bc.HubBeamParameters(
    length=0.4,
    density=7800.0,
    area=2e-5,
    youngs_modulus=2e11,
    second_moment=1.667e-12,
    hub_inertia=2e-3,
    hub_radius=0.02,
)


def rig(p):
    beam = drawn.replace(youngs_modulus=p["youngs_modulus"], damping_ratio=p["damping_ratio"])
    model = bc.hub_beam(beam, model="sfoam", modes=2).to_second_order()
    friction = np.zeros_like(model.C)
    friction[0, 0] = p["friction"]
    inputs = dict(zip(model.input_labels, model.ports.B[0].T, strict=True))
    outputs = dict(zip(model.output_labels, model.ports.L[0], strict=True))
    return SecondOrderModel(
        model.M,
        model.C + friction,
        model.K,
        {"torque": p["gain"] * inputs["torque"], "tip_force": inputs["tip_force"]},
        {name: outputs[name] for name in ("hub_angle", "tip_displacement")},
    )


nominal = {"gain": 1.0, "friction": 5e-3, "youngs_modulus": 2.0e11, "damping_ratio": 0.01}
truth = {"gain": 0.91, "friction": 8e-3, "youngs_modulus": 1.86e11, "damping_ratio": 0.014}

# %% [markdown]
# ## The record
#
# Noise up to 60 Hz shakes the motor. The encoder has counts, the gauge has noise.

# %%
step, samples, count = 0.004, 15_000, 2.0 * np.pi / 8192
rng = np.random.default_rng(0)
omega = 2.0 * np.pi * np.fft.rfftfreq(2 * samples, step)
spectrum = np.fft.rfft(rng.standard_normal(2 * samples)) * (omega < 2.0 * np.pi * 60.0) * (omega > 0.0)
spectrum *= 0.05 / np.fft.irfft(spectrum).std()
G = rig(truth).frequency_response(omega[1:], ["torque"]).frdata[:, 0]
angle, tip = np.fft.irfft(np.c_[[0.0, 0.0], G] * spectrum, axis=1)[:, samples:]
torque = {"torque": np.fft.irfft(spectrum)[samples:]}
seen = {"hub_angle": count * np.round(angle / count), "tip_displacement": tip + 2e-5 * rng.standard_normal(samples)}

# %% [markdown]
# ## Frequency response
#
# Each frequency comes with its deviation and coherence.

# %%
response = bc.estimate_frequency_response(torque, seen, step, frequency_range_hz=(0.5, 40.0))
print(response)
axes = response.plot()
plt.show()

# %% [markdown]
# ## Parameters and confidence intervals
#
# `bc.fit` begins from the drawing. Its intervals come from residuals correlated over frequency, not from a formula for
# white noise.

# %%
fitted = bc.fit(rig, response, list(nominal), nominal, n_starts=1)
print(fitted)
print("truth:", ", ".join(f"{name} {value:g}" for name, value in truth.items()))
axes = fitted.plot()
plt.show()

# %% [markdown]
# ## A family of models
#
# The box holds all four at once with 95 %, and five percent more to either side: a rig does not stay what it was.

# %%
family = fitted.family(probability=0.95, range_margin=0.05)
print("\n".join(f"{name}: {low:.4g} to {high:.4g}" for name, (low, high) in family.ranges.items()))

# %% [markdown]
# What the fit leaves of the response becomes a band: filters that lie above it, and above what noise may hide.

# %%
model = rig(fitted.parameters)
band = bc.identification.uncertainty_weight(response, model, "torque", "hub_angle")
w = response.omega
left = response.frdata[0, 0] - model.frequency_response(w, ["torque"], ["hub_angle"]).frdata[0, 0]
fig, ax = plt.subplots()
ax.loglog(w / (2 * np.pi), abs(response.frdata[0, 0]), label="measured")
ax.loglog(w / (2 * np.pi), abs(left), label="left by the fit")
ax.loglog(w / (2 * np.pi), abs(band(1j * w)), label="band")
ax.set(xlabel="frequency [Hz]", ylabel="torque to hub angle [rad/(N m)]")
ax.legend()
plt.show()

# %% [markdown]
# ## Tuned PD controller with notch
#
# It reads the encoder alone. The worst point of the box counts.

# %%
weighed = partial(
    bc.generalized_plant,
    disturbances={"torque": 0.02, "tip_force": 0.05},
    performance={"hub_angle": 20.0, "tip_displacement": 50.0},
    effort={"torque": 5.0},
    noise={"hub_angle": 10.0 * count},
    measurements="hub_angle",
    controls="torque",
)
structure = tunable.pid(integral=False, omega_max=400.0) * tunable.notch(20.0, 400.0)
design = bc.tune(weighed, structure=structure, family=family, n_starts=1, fastest_pole=400.0)
print(repr(design))

# %% [markdown]
# Beside it an H-infinity controller for the same weights. It has as many states as the rig, and knows the fitted rig
# alone; the box is left to the proof.

# %%
optimal = bc.h_infinity(weighed(model), fastest_pole=400.0)
print(optimal)

# %% [markdown]
# ## Robust stability of the sampled loops
#
# A controller runs 250 times a second, and its torque comes a millisecond late. Both loops are proved stable at every
# point of the box, with anything beside it that is within the band, and how far a push at the tip may turn the hub is
# bounded.

# %%
drives = {
    "PD with notch": bc.discretize(design.controller, step),
    "H-infinity": bc.discretize(optimal.controller, step),
}
for name, K in drives.items():
    print(name)
    print(bc.robust_stability(family, K, delay=0.001, additive_uncertainty=band))
    print(bc.worst_case(family, K, "tip_force", "hub_angle", delay=0.001, rtol=0.05))

# %% [markdown]
# Twice the states gain a few percent here. The simple controller is the one to take.

# %% [markdown]
# ## C code
#
# The PD with notch as C99, with vectors to test it on the target.

# %%
with tempfile.TemporaryDirectory() as folder:
    drive = drives["PD with notch"]
    bc.write_controller(drive, Path(folder) / "drive.c")
    print([path.name for path in sorted(Path(folder).iterdir())])

# %% [markdown]
# ## Simulation of the true rig
#
# A push at the tip for a fifth of a second: the hub comes back, encoder counts and all.

# %%
t = step * np.arange(501)
push = {"tip_force": np.where((t >= 0.2) & (t < 0.4), 0.05, 0.0)}
loop = bc.simulate_loop(rig(truth), drive, t, push, sample_time=step, delay=0.001, quantization=count)
print(
    f"largest angle {np.abs(loop['hub_angle']).max():.4f} rad, at last {np.abs(loop['hub_angle'][-50:]).max():.5f} rad"
)
axes = loop.plot()
plt.show()
