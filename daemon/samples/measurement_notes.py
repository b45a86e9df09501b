"""Notes on a measurement: from the command or the page, from readers, and masses weighed earlier.

A reader is a plug-in: a function without arguments under the entry point group `pzctl.readers`, named in `readers` of
config.toml, that returns keys and values such as {"temperature_C": 23.1}.
"""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from importlib.metadata import entry_points

from ...models.base.errors import PzctlError
from ...models.base.names import among
from ...models.build import Build, Quantity
from ...models.metadata import check_metadata
from .sample_selection import NoSamplesError, open_journal

GROUP = "pzctl.readers"


HEAVIEST_GRAMS = 1e6


class ReaderError(PzctlError):
    """A reader of metadata is not installed, or failed."""


def noted_build(
    build: Build, step: str, metadata: Mapping[str, str | float], mass: Quantity | None, readers: Sequence[str] = ()
) -> Build:
    """Return the build for a measurement: with the values of the readers, then `metadata`, and all known masses.

    The mass of an earlier step comes from that step's measurement in the journal unless the build states it. Raises
    ReaderError, MetadataError, JournalError.
    """
    notes = dict[str, str | float]()
    for name in readers:
        notes |= read_notes(name)
    return with_earlier_masses(build).noted(step, {**notes, **metadata}, mass)


def read_notes(name: str) -> dict[str, str | float]:
    """Return the values of a reader. Raises ReaderError, MetadataError."""
    found = entry_points(group=GROUP)
    if name not in found.names:
        raise ReaderError(f"reader {name!r} is not installed; {among(name, sorted(found.names))}")
    try:
        notes = dict(found[name].load()())
    except Exception as error:  # a plug-in may raise anything
        raise ReaderError(f"reader {name!r} cannot read: {error or type(error).__name__}") from error
    check_metadata(notes, f"reader {name!r}")
    return notes


def with_earlier_masses(build: Build) -> Build:
    """Return the build with the mass of each step from the newest measurement of this sample, unless it states it."""
    try:
        journal = open_journal()
    except NoSamplesError:
        return build
    with closing(journal):
        steps = list(build.steps)
        for k, step in enumerate(steps):
            if step.mass is None:
                measured = journal.measurements("sample = ? AND step = ? AND state = 'measured'", build.name, step.name)
                earlier = journal.build(measured[-1].id) if measured else build
                mass = next((one.mass for one in earlier.steps if one.name == step.name), None)
                steps[k] = replace(step, mass=mass)
    return replace(build, steps=tuple(steps))


def mass_of(text: str) -> Quantity:
    """Return the mass (kg) that was typed as `GRAMS:UNCERTAINTY`, also with decimal commas. Raises ValueError."""
    value, _, u = text.replace(",", ".").partition(":")
    grams, uncertainty = float(value), float(u)
    if not (0 < grams < HEAVIEST_GRAMS and 0 < uncertainty < grams):
        raise ValueError(text)
    return Quantity(grams / 1e3, u=uncertainty / 1e3, source="balance")
