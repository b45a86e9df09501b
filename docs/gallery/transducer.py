# %% [markdown]
# # A transducer through three steps
#
# A disk, a first matching layer glued onto it, and a second one. Each step is measured; all are fitted together, so
# that the disk's constants stay what they are, with their uncertainty, while the layers' are found.

# %%
from pathlib import Path

import numpy as np

import pzctl

# %%
Path("transducer.toml").write_text("""
name = "T1"
diameter_mm = 16.0

[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = { value = 0.512, u = 0.001 }

[[layers]]
name = "glue1"
kind = "elastic"
z_MRayl = 2.8
c_m_s = 2450
q = 13
thickness_mm = { value = 0.010, u = 0.005 }

[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = { value = 10.3, u = 0.5 }
c_m_s = { value = 2455, u = 150 }
q = { value = 60, u = 30 }
thickness_mm = { value = 0.139, u = 0.001 }

[[layers]]
name = "glue2"
kind = "elastic"
z_MRayl = 2.8
c_m_s = 2450
q = 13
thickness_mm = { value = 0.005, u = 0.003 }

[[layers]]
name = "ml2"
kind = "elastic"
z_MRayl = { value = 2.4, u = 0.15 }
c_m_s = { value = 2250, u = 150 }
q = { value = 35, u = 15 }
thickness_mm = { value = 0.147, u = 0.001 }

[load]
back = "air"
front = "air"

[[steps]]
name = "disk"
layers = ["disk"]

[[steps]]
name = "ml1"
layers = ["disk", "glue1", "ml1"]

[[steps]]
name = "ml2"
layers = ["disk", "glue1", "ml1", "glue2", "ml2"]
""")
steps = ("disk", "ml1", "ml2")

# %% [markdown]
# The recordings of the three steps, computed from constants that differ from the data sheets, with the noise of an
# analyzer:

# %%
true = {
    "disk.c33D.re": 1.51e11,
    "glue1.thickness": 9e-6,
    "ml1.z": 11.0e6,
    "ml1.q": 20.0,
    "ml2.z": 2.36e6,
    "ml2.q": 20.0,
}
f = np.linspace(1e6, 6e6, 301)
rng = np.random.default_rng(2)
recordings = {}
for step in steps:
    model = pzctl.model("transducer.toml", step)
    model = model.replace({name: value for name, value in true.items() if name in model.parameters()})
    noise = rng.normal(scale=3e-4, size=(2, f.size))
    recordings[step] = pzctl.Sweep(f, model.impedance(f) * np.exp(noise[0] + 1j * noise[1]))

# %%
found = pzctl.fit("transducer.toml", recordings)
found.plot()

# %%
for name, value in true.items():
    fitted = found[name.removesuffix(".re")]
    print(f"{name:16} true {value:10.4g}  fitted {fitted.re:10.4g} +- {fitted.u_re:.1g} {fitted.unit}")

# %% [markdown]
# What the recordings cannot separate is said, with what they do determine:

# %%
print("\n".join(found.result.says))
