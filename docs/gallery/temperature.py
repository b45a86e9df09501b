# %% [markdown]
# # Constants against temperature
#
# A disk is measured at six temperatures. Each recording is fitted; a polynomial through the constants gives the
# temperature coefficients with their uncertainties. On the command line it is `pzctl trend`, over the measurements of
# the journal.

# %%
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import pzctl

# %%
Path("disk.toml").write_text("""
name = "D1"
diameter_mm = 16.0

[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = { value = 0.512, u = 0.001 }

[load]
back = "air"
front = "air"

[[steps]]
name = "disk"
layers = ["disk"]
""")
disk = pzctl.model("disk.toml", "disk")
values = disk.parameters()
rng = np.random.default_rng(4)
f = np.linspace(2e6, 6e6, 301)

# %% [markdown]
# The stiffness falls by 120e-6 per kelvin, the permittivity rises by 2500e-6 per kelvin:

# %%
temperatures = [15.0, 20.0, 25.0, 30.0, 40.0, 50.0]  # C
fits = []
for t in temperatures:
    change = {"disk.c33D.re": 1 - 120e-6 * (t - 25), "disk.eps33S.re": 1 + 2500e-6 * (t - 25)}
    warm = disk.replace({name: values[name] * factor for name, factor in change.items()})
    noise = rng.normal(scale=3e-4, size=(2, f.size))
    recording = pzctl.Sweep(f, warm.impedance(f) * np.exp(noise[0] + 1j * noise[1]))
    fits.append(pzctl.fit("disk.toml", {"disk": recording}, free=["disk.c33D", "disk.h33", "disk.eps33S"]))

# %% [markdown]
# Thickness and density are held: it is the same disk. If each fit were free to change them within their
# uncertainties, it would put a little of the permittivity's change into the thickness, and the slope of the stiffness
# would be 1.4 % wrong.
#
# An error that all six measurements share, such as that of the thickness, changes the value but hardly its slope. So
# the uncertainty of the slope comes from the scatter around the line:

# %%
figure = Figure(figsize=(8, 3.2), layout="constrained")
for place, name in zip(figure.subplots(1, 2), ("disk.c33D", "disk.eps33S"), strict=True):
    constants = [fit[name] for fit in fits]
    trend = pzctl.trend(temperatures, [one.re for one in constants], degree=1, reference=25.0)
    slope = trend.relative[0]
    print(f"{name}: {trend.value.value:.4g} {constants[0].unit} at 25 C")
    print(f"    changes by {1e6 * slope.value:.1f} +- {1e6 * slope.u:.1f} e-6/K")
    place.plot(temperatures, [one.re for one in constants], "o")
    place.plot(temperatures, [trend.at(t) for t in temperatures])
    place.set(title=f"{name} ({constants[0].unit})", xlabel="temperature (C)")
figure
