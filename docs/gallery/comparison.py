# %% [markdown]
# # Before and after
#
# Two recordings of a device, and the question what has changed in between. No model of the device is needed: the
# device is the first recording. Here a cable was changed, which added 6 pF.

# %%
import numpy as np

import pzctl

# %% [markdown]
# Any device will do; this is one of two resonances, without a build.

# %%
f = np.linspace(0.2e6, 2e6, 401)
w = 2 * np.pi * f


def branch(fs, q, c):
    """Return the admittance of a resonance: frequency (Hz), Q, and motional capacitance (F)."""
    inductance = 1 / ((2 * np.pi * fs) ** 2 * c)
    resistance = 2 * np.pi * fs * inductance / q
    return 1 / (resistance + 1j * w * inductance + 1 / (1j * w * c))


device = 1j * w * 400e-12 + branch(0.5e6, 60, 40e-12) + branch(1.4e6, 40, 8e-12)
rng = np.random.default_rng(5)


def measured(admittance):
    """Return a recording with the noise of an analyzer."""
    noise = rng.normal(scale=3e-4, size=(2, f.size))
    return pzctl.Sweep(f, np.exp(noise[0] + 1j * noise[1]) / admittance)


before, after = measured(device), measured(device + 1j * w * 6e-12)

# %%
change = pzctl.compare(before, after)
print(change.verdict)
print("\n".join(f"{one['effect']} {one['where']}, p {one['probability']:.3f}" for one in change.to_json()["findings"]))

# %%
change.plot()

# %% [markdown]
# Twice the same device, and the answer is that nothing has changed, with what would have been seen:

# %%
print(pzctl.compare(before, measured(device)).verdict)
