# %% [markdown]
# # What does the model lack?
#
# A recording that the model does not describe: the disk was measured over a wire of 40 nH, which nobody noted. The
# diagnosis names the wire, with its size and its probability, and gives the constants that are right in spite of it.

# %%
from pathlib import Path

import numpy as np

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
f = np.linspace(2e6, 6e6, 401)
noise = np.random.default_rng(3).normal(scale=3e-4, size=(2, f.size))
Z = pzctl.model("disk.toml", "disk").impedance(f) + 2j * np.pi * f * 40e-9
recording = pzctl.Sweep(f, Z * np.exp(noise[0] + 1j * noise[1]))

# %% [markdown]
# The fit converges, and its constants look plausible. Only the misfit tells that they are wrong:

# %%
found = pzctl.fit("disk.toml", {"disk": recording})
print(f"chi2 per degree of freedom {found.result.chi2_per_dof:.0f}, kt {found['disk.kt'].re:.4f}")

# %% [markdown]
# Without `effects`, the whole catalogue is considered. Four are enough here:

# %%
effects = ["lead-inductance", "series-resistance", "stray-capacitance", "electrode-mass"]
diagnosis = pzctl.diagnose("disk.toml", {"disk": recording}, effects=effects)
print(diagnosis.verdict)
for finding in diagnosis.findings:
    print(f"{finding.effect} at {finding.where}, probability {finding.probability:.3f}: {finding.says}")

# %%
diagnosis.plot()

# %% [markdown]
# The coupling, before and after; the true one is that of the data sheet, 0.4695:

# %%
c33D, h33, eps33S = (diagnosis[f"disk.{name}"].re for name in ("c33D", "h33", "eps33S"))
print(f"fit {found['disk.kt'].re:.4f}, with the wire {h33 * (eps33S / c33D) ** 0.5:.4f}")
