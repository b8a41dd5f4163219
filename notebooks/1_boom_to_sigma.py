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
# # 1. Singular values of the spray boom
#
# A sprayer drives over a rough field. Its boom is 12 m long and only 2 cm deep, so that it vibrates, and the spray is
# uneven. This notebook builds a model of the boom, compares it with the values published by J. Anthonis and H. Ramon
# in 2003 (*Journal of Sound and Vibration* 266, 535-552), and compares it with a measured frequency response.
#
# This is the machine, seen from above. It drives upwards on the page.
#
# ```
#        tip_left                      hinge                     tip_right
#           o============================O============================o      boom, 12 m, bends
#                              |      [cradle]     |                    ^
#                            spring      :       spring                 | y, driving direction
#                              |         : slides  |                    |
#                            +=====================+                    +---> x
#                               | platform     |
#                        actuator_left   actuator_right     (the tractor moves these two points)
# ```
#
# * Two **actuators** move the platform. They impose a *displacement*, not a force: the tractor is much heavier.
# * The **cradle** slides on the platform. A damper acts between them.
# * The **boom** is hinged on the cradle. Two springs between platform and boom hold it straight.

# %%
import tempfile
from dataclasses import replace
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import boomctl as bc

plt.style.use("boomctl.plotting.look")  # or a style of your own
p = bc.BoomParameters()  # Table 2 of the paper
p

# %% [markdown]
# ## The model and Table 1
#
# The boom is divided into six finite elements, as in the paper. The model has five named inputs and five named
# outputs.

# %%
boom = bc.spray_boom(p, discretization="finite", elements=6)
boom

# %% [markdown]
# **Question:** does the model reproduce the frequencies of Table 1 of the paper? The platform is held by its
# actuators. The frequencies are those of the damped system, as in the paper.

# %%
published, measured = bc.boom.published.COMPUTED_HZ, bc.boom.published.MEASURED_HZ  # as printed in Table 1
computed = {kind: bc.spray_boom(p, *kind).eigenfrequencies_hz(5) for kind in published}
exact = bc.exact_eigenfrequencies_hz(p, 5)
print("frequencies in Hz, mode          ", "".join(f"{k:9d}" for k in range(1, 6)))
for kind, printed in published.items():
    print(f"{kind[0]:19} {kind[1]:2d} elements  paper", "".join(f"{f:9.4f}" for f in printed))
    print(f"{'':32}  here", "".join(f"{f:9.4f}" for f in computed[kind]))
print(f"{'exact beam, no elements':32}  here", "".join(f"{f:9.4f}" for f in exact))
print(f"{'measured':32} paper", "".join(f"{f:9.2f}" for f in measured))

assert np.allclose(computed["finite", 6], published["finite", 6], rtol=1e-4)
assert np.allclose(computed["discrete-hermite", 6], published["discrete-hermite", 6], rtol=2e-3)

# %% [markdown]
# **Result:** the finite elements agree in all printed digits but the last. The discrete elements with Hermitian mass
# agree to 0.2 %. The third method does not: the fourth frequency is printed as 2.9316 Hz, and the model has 2.7451
# Hz. The cause is unknown: none of several meshes gives the printed value.
#
# **Conclusion:** the model is the paper's model. The measured first frequency, 0.34 Hz, is far from the 0.245 Hz of
# the model. The last section discusses this.
#
# ## Mode shapes
#
# **Question:** what are the mode shapes? The platform moves sinusoidally at each natural frequency, and the amplitude
# of each point of the boom is computed. In **yaw** the two actuators move in antiphase, in **jolt** in phase.

# %%
x = np.linspace(-6.0, 6.0, 61)
fine = bc.spray_boom(p, elements=24, nozzles=x)  # also reads the displacement at these places
names = [name for name in fine.output_labels if name.startswith("nozzle")]
fig, axes = plt.subplots(1, 5, figsize=(10, 2.2), sharey=True, layout="constrained")
for ax, f in zip(axes, exact, strict=True):
    response = fine.frequency_response([2 * np.pi * f], ["actuator_left", "actuator_right"], names).frdata[:, :, 0]
    yaw_shape, jolt_shape = response @ [-1, 1], response @ [1, 1]
    kind, shape = max(("yaw", yaw_shape), ("jolt", jolt_shape), key=lambda item: abs(item[1][-1]))
    at_largest = shape[np.argmax(abs(shape))]
    ax.plot(x, (shape / at_largest).real)
    ax.set(title=f"{f:.3f} Hz, {kind}", xlabel="x [m]", ylim=(-1.1, 1.1))
axes[0].set_ylabel("displacement, largest = 1")
plt.show()

# %% [markdown]
# **Result:** at 0.244 Hz the boom turns about its hinge and stays almost straight. At 0.586 and at 0.933 Hz boom and
# cradle move forward and back. The higher modes bend. The modes of yaw and jolt are decoupled, because the machine is
# symmetric.
#
# ## Singular values
#
# **Question:** by how much is motion of the platform amplified at the tips? The system has two inputs and two
# outputs, so that one curve is not enough. At each frequency the *singular values* are the largest and the smallest
# amplification over all directions of the input, that is, all combinations of the two actuators. This is Fig. 3 of
# the paper.

# %%
s = bc.sigma(boom)  # actuators to tips
beam = bc.sigma(bc.exact_frequency_response(p, s.omega, ["actuator_left", "actuator_right"], ["tip_left", "tip_right"]))
jolt, yaw = bc.split_symmetric(boom)
peak_jolt = bc.sigma(jolt, inputs="actuator_sym", outputs="tip_sym").peak
peak_yaw = bc.sigma(yaw, inputs="actuator_anti", outputs="tip_anti").peak
print(f"peak {s.peak:.1f} at {s.peak_omega / (2 * np.pi):.4f} Hz, certified: {s.certified}")
print(f"largest amplification of yaw {peak_yaw:.1f}, of jolt {peak_jolt:.1f}")

ax = s.plot(label="6 finite elements")
beam.plot(ax, label="exact beam", linestyle="--")
for f in measured:
    ax.axvline(f, color="0.5", linewidth=0.8, linestyle="--")
ax.set(xlim=(0.1, 10), ylim=(1e-3, 5e3), title="Platform to tips; grey lines: measured frequencies")
plt.show()

# %% [markdown]
# **Result:** the largest singular value has a very sharp peak of 2472.8: at 0.245 Hz one millimeter at the platform
# becomes more than two meters at the tips. It belongs to the yaw; the largest peak of the jolt is 49.7.
#
# **Conclusion:** a suspension must first of all damp the yaw. And six elements are enough up to about 5 Hz.
#
# ## Certified peak
#
# The peak is so narrow that a usual frequency grid misses it. boomctl proves that no frequency has a larger value.
# The comparison is with the default grid of python-control.

# %%
G = boom.to_statespace(["actuator_left", "actuator_right"], ["tip_left", "tip_right"])
on_grid = np.max(np.abs(control.singular_values_response(G).frdata))
print(
    f"largest value on the default grid {on_grid:.0f}, verified peak {s.peak:.0f}: {s.peak / on_grid:.1f} times larger"
)

# %% [markdown]
# ## Comparison with a measurement
#
# The paper shows its measured curve as a figure only, so that a measurement is simulated here. The simulated boom has
# springs that are stiff enough for a yaw mode at the measured 0.34 Hz, and the values have 10 % noise. The file has
# columns of numbers.

# %%
stiff = replace(p, spring_stiffness=float(bc.boom.yaw_family(p, max_yaw_frequency_hz=0.34).high[0]))
freq_hz = np.geomspace(0.15, 8.0, 150)
truth = bc.sigma(
    bc.exact_frequency_response(
        stiff, 2 * np.pi * freq_hz, ["actuator_left", "actuator_right"], ["tip_left", "tip_right"]
    )
)
noise = np.exp(0.1 * np.random.default_rng(1).standard_normal(truth.sigma.shape))
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "measured.csv"
    rows = np.column_stack([freq_hz, *(truth.sigma * noise)])
    np.savetxt(file, rows, delimiter=",", header="freq_hz,sigma_1,sigma_2", comments="")
    curve = bc.read_frequency_response(file)
curve

# %%
ax = s.plot(label="model, Table 2")
curve.plot(ax, label="synthetic measurement")
ax.set(xlim=(0.1, 10), ylim=(1e-3, 5e3), title="Model and synthetic measurement")
plt.show()

# %% [markdown]
# **Result:** the measured peaks are at higher frequencies than those of the model, not only the peak of the yaw. How
# far do the others move if the springs are stiff enough for 0.34 Hz?

# %%
print(f"springs: {p.spring_stiffness:.0f} N/m in Table 2, {stiff.spring_stiffness:.0f} N/m for a yaw at 0.34 Hz")
shifted = bc.exact_eigenfrequencies_hz(stiff, 5)
print("springs of Table 2", "".join(f"{f:8.3f}" for f in exact))
print("stiffer springs   ", "".join(f"{f:8.3f}" for f in shifted))
print("measured          ", "".join(f"{f:8.2f}" for f in measured))

assert abs(shifted[0] - 0.34) < 0.005
assert shifted[2] > 1.4 * measured[2]

# %% [markdown]
# **Conclusion:** springs of 2375 N/m correct the yaw frequency, but they move the third frequency to 1.310 Hz, and
# 0.88 Hz was measured. With the springs of Table 2 the second and the third frequency, 0.586 and 0.933 Hz, are within
# 6 % of the measured ones. So stiffer springs alone do not explain the measured 0.34 Hz. Another stiffness must act
# on the yaw, for instance friction in the hinge or a hose. A controller must therefore be robust to uncertain
# springs, see notebook 3.
