"""Several devices before and after: the common changes, the changes of single devices, and the outliers.

Every pair is compared separately. A change that most of them show is common to all (the jig, the cable); its sizes are
treated as a sample of a normal distribution, whose mean and scatter are separated from the uncertainty of each (random
effects: DerSimonian and Laird, Controlled Clinical Trials 7 (1986) 177). A device far from the others is an outlier.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ...models.sweep import Sweep
from ..diagnosis.findings import Size
from ..interface import TaskError
from .compare import compare
from .comparison import ChangeFinding, Comparison

_COMMON = 0.5
"""Fraction of the devices above which a change is common."""
_OUTLIER = 3.5
"""Distance from the median, in robust standard deviations, beyond which a device is an outlier."""
_SCATTER = 1.4826
"""Standard deviation of a normal density, in median absolute deviations."""


@dataclass(frozen=True)
class CommonChange:
    """A change that most devices show."""

    effect: str
    where: str
    removed: bool
    devices: tuple[int, ...]
    """Numbers of the devices that show it, from 0."""
    parameters: dict[str, Size]
    """The mean over the devices without outliers, with its standard uncertainty."""
    scatter: dict[str, Size]
    """Standard deviation from device to device, without the uncertainty of each; `u` is 0."""
    says: str


@dataclass(frozen=True, eq=False)
class ManyCompared:
    """All devices together."""

    devices: tuple[Comparison, ...]
    common: tuple[CommonChange, ...]
    own: tuple[tuple[ChangeFinding, ...], ...]
    """By device, the changes that the others do not show."""
    outliers: tuple[int, ...]
    says: tuple[str, ...]


def compare_many(
    before: Sequence[Sweep], after: Sequence[Sweep], progress: Callable[[str], None] = lambda _: None
) -> ManyCompared:
    """Return the changes of several devices; a single recording before is used for all. Raises TaskError."""
    if len(before) not in (1, len(after)):
        raise TaskError(
            f"{len(before)} recordings before and {len(after)} after; as many on both sides are needed, "
            "or one before that all are held against"
        )
    firsts = list(before) * len(after) if len(before) == 1 else list(before)
    devices: list[Comparison] = []
    for k, (first, second) in enumerate(zip(firsts, after, strict=True)):
        progress(f"device {k + 1} of {len(after)}")
        devices.append(compare([first], [second]))
    return _joined(tuple(devices))


def _joined(devices: tuple[Comparison, ...]) -> ManyCompared:
    keys = list(dict.fromkeys(_key(one) for device in devices for one in device.findings))
    common = tuple(made for key in keys if len((made := _common(devices, key)).devices) > _COMMON * len(devices))
    shared = {(one.effect, one.where, one.removed) for one in common}
    own = tuple(tuple(one for one in device.findings if not _among(one, shared)) for device in devices)
    outliers = _outliers(devices, common)
    return ManyCompared(devices, common, own, outliers, _says(devices, common, own, outliers))


def _key(finding: ChangeFinding) -> tuple[str, str, bool]:
    return finding.effect, finding.where, finding.removed


def _among(finding: ChangeFinding, keys: "set[tuple[str, str, bool]]") -> bool:
    """Return whether a finding is one of these or a look-alike."""
    names = {finding.effect, *(other.effect for other in finding.same_as)}
    return any(effect in names and finding.removed == removed for effect, _, removed in keys)


def _common(devices: Sequence[Comparison], key: tuple[str, str, bool]) -> CommonChange:
    """Return a change with its mean size and its scatter over the devices that show it, without outliers."""
    every = {k: one for k, device in enumerate(devices) for one in device.findings if _key(one) == key}
    showing = {k: one for k, one in every.items() if k not in _far(_first_sizes(every))}
    alike = [k for k, device in enumerate(devices) if any(_among(one, {key}) for one in device.findings)]
    parameters: dict[str, Size] = {}
    scatter: dict[str, Size] = {}
    for name in next(iter(showing.values())).parameters:
        sizes = [one.parameters[name] for one in showing.values() if name in one.parameters]
        mean, u, spread = random_effects(np.array([size.value for size in sizes]), np.array([size.u for size in sizes]))
        parameters[name] = Size(mean, u, sizes[0].unit)
        scatter[name] = Size(spread, 0.0, sizes[0].unit)
    says = next(iter(showing.values())).says
    return CommonChange(*key, tuple(alike), parameters, scatter, says)


def random_effects(values: Reals, u: Reals) -> tuple[float, float, float]:
    """Return mean, its standard uncertainty and the scatter of values that are uncertain by `u`, shapes (K,)."""
    weight = 1 / np.maximum(u, 1e-12 * np.max(np.abs(values)) + 1e-300) ** 2
    mean = float(np.sum(weight * values) / np.sum(weight))
    spread2 = 0.0
    if values.size > 1:
        excess = float(np.sum(weight * (values - mean) ** 2)) - (values.size - 1)
        spread2 = max(0.0, excess / float(np.sum(weight) - np.sum(weight**2) / np.sum(weight)))
    weight = 1 / (1 / weight + spread2)
    mean = float(np.sum(weight * values) / np.sum(weight))
    return mean, float(np.sum(weight) ** -0.5), float(np.sqrt(spread2))


def _outliers(devices: Sequence[Comparison], common: Sequence[CommonChange]) -> tuple[int, ...]:
    """Return the devices that lack a change of all others, or show it with a size far from theirs."""
    found: set[int] = set()
    for one in common:
        found |= set(range(len(devices))) - set(one.devices)
        key = one.effect, one.where, one.removed
        showing = {k: finding for k in one.devices for finding in devices[k].findings if _key(finding) == key}
        found |= _far(_first_sizes(showing))
    if not common:
        found |= _far({k: float(np.log(device.change)) for k, device in enumerate(devices)})
    return tuple(sorted(found))


def _first_sizes(showing: Mapping[int, ChangeFinding]) -> dict[int, float]:
    """Return the main size of a change, by device."""
    return {k: next(iter(one.parameters.values())).value for k, one in showing.items() if one.parameters}


def _far(sizes: dict[int, float]) -> set[int]:
    values = np.array(list(sizes.values()))
    if values.size < 4:
        return set()
    middle = float(np.median(values))
    spread = _SCATTER * float(np.median(np.abs(values - middle)))
    least = 0.02 * abs(middle)
    return {k for k, value in sizes.items() if abs(value - middle) > _OUTLIER * max(spread, least)}


def _says(
    devices: Sequence[Comparison],
    common: Sequence[CommonChange],
    own: Sequence[tuple[ChangeFinding, ...]],
    outliers: Sequence[int],
) -> tuple[str, ...]:
    still = sum(device.verdict == "unchanged" for device in devices)
    said = [f"{len(devices)} devices, {still} of them unchanged."]
    said += [f"In common ({len(one.devices)} of {len(devices)}): {one.says}" for one in common]
    said += [f"Device {k + 1} alone: {finding.says}" for k, findings in enumerate(own) for finding in findings]
    if outliers:
        said.append(f"Unlike the others: device {', '.join(str(k + 1) for k in outliers)}.")
    return tuple(said)
