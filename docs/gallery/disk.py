# %% [markdown]
# # Fit of a disk
#
# A bare piezoceramic disk, its recording, and the constants with their uncertainties. The recording is computed here,
# with the noise of a good analyzer, so that the true constants are known; `pzctl.read("disk.csv")` reads one of
# yours.

# %%
from pathlib import Path

import numpy as np

import pzctl

# %% [markdown]
# The build says what is known before the fit: the dimensions with their uncertainties, and the material, whose data
# sheet gives the start values.

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
nominal = pzctl.model("disk.toml", "disk")
true = {"disk.c33D.re": 1.50e11, "disk.c33D.im": 1.6e9, "disk.h33.re": 1.97e9, "disk.eps33S.re": 7.5e-9}
f = np.linspace(2e6, 6e6, 401)  # Hz
noise = np.random.default_rng(1).normal(scale=3e-4, size=(2, f.size))
Z = nominal.replace(true).impedance(f) * np.exp(noise[0] + 1j * noise[1])
recording = pzctl.Sweep(f, Z)

# %% [markdown]
# The fit is one call. The table is the one that the command line prints.

# %%
found = pzctl.fit("disk.toml", {"disk": recording})
print(found)

# %%
found.plot()

# %% [markdown]
# Each constant has its value, its standard uncertainty and its unit. All true values lie within two uncertainties:

# %%
for name, value in true.items():
    constant, part = name.rsplit(".", 1)
    fitted = found[constant]
    got, u = (fitted.re, fitted.u_re) if part == "re" else (fitted.im, fitted.u_im)
    print(f"{name:15} true {value:.4g}  fitted {got:.4g} +- {u:.1g} {fitted.unit}  ({abs(got - value) / u:.1f} u)")

# %% [markdown]
# What limits the stiffness? The budget says: not the recording, but the micrometer and the balance.

# %%
share = found.result.budget.re["disk.c33D"]
print(f"noise {share.noise:.1g}, dimensions {share.dimensions:.1g} Pa; the largest: {share.largest[0]}")
