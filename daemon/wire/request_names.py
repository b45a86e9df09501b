"""Checks of the names in a request, since they appear on screens, in logs, files and tables."""

from collections.abc import Iterator

from ...models.base.names import LONGEST_NAME, NameFault, check_name
from ...models.build import Build
from ...models.metadata import MetadataError, check_metadata
from . import requests as ask
from .frames import WireError

LONGEST_OWNER = 200
"""Greatest number of characters of a person's name."""

LONGEST_TEXT = 1000
"""Greatest number of characters of a text in a build, such as the source of a value."""

ON_AN_ANALYZER = (ask.MeasureRequest, ask.LeaseRequest, ask.CancelRequest, ask.BenchRequest)
"""Requests that may name an analyzer."""

LONGEST_VERSION = 4000
"""Greatest number of characters of a version; that of a diagnosis names further measurements."""


def check_names(request: ask.Request) -> None:
    """Raise WireError if the name of a sample, step, layer, fitter or person in a request is not allowed."""
    try:
        for name, what, longest in _names(request):
            check_name(name, f"request: {what}", longest)
        if isinstance(request, ask.MeasureRequest):
            check_metadata(request.build.metadata, "request: metadata")
    except (NameFault, MetadataError) as fault:
        raise WireError(str(fault)) from None


def _names(request: ask.Request) -> Iterator[tuple[str, str, int]]:
    """Yield each name with the field it is from and its greatest length."""
    if request.by is not None:
        yield request.by, "by", LONGEST_OWNER
    if isinstance(request, ask.WithdrawRequest):
        yield request.why, "why", ask.LONGEST_REASON
    if isinstance(request, ask.MeasureRequest):
        yield from _of_build(request.build)
    if isinstance(request, ask.HelloRequest | ask.SubmitRequest):
        if request.fitter is not None:
            yield request.fitter, "fitter", LONGEST_NAME
        if request.version:
            yield request.version, "version", LONGEST_VERSION
    if isinstance(request, ON_AN_ANALYZER) and request.analyzer is not None:
        yield request.analyzer, "analyzer", LONGEST_NAME
    if isinstance(request, ask.LeaseRequest):
        yield request.owner, "owner", LONGEST_OWNER


def _of_build(build: Build) -> Iterator[tuple[str, str, int]]:
    yield build.name, "name of the build", LONGEST_NAME
    for k, step in enumerate(build.steps):
        yield step.name, f"name of steps[{k}]", LONGEST_NAME
    for k, layer in enumerate(build.layers):
        yield layer.name, f"name of layers[{k}]", LONGEST_NAME
    for load, side in ((build.back, "back"), (build.front, "front")):
        yield load.name, f"name of the {side} load", LONGEST_NAME
    yield from _in_build(build)


def _in_build(build: Build) -> Iterator[tuple[str, str, int]]:
    """Yield the texts that reports and tables show of layers and effects."""
    for k, layer in enumerate(build.layers):
        if layer.material is not None:
            yield layer.material, f"material of layers[{k}]", LONGEST_TEXT
        for name, quantity in (*layer.values.items(), *layer.nominal.items()):
            yield name, f"name of a constant of layers[{k}]", LONGEST_NAME
            if quantity.source:
                yield quantity.source, f"source of {name} of layers[{k}]", LONGEST_TEXT
    for k, effect in enumerate(build.effects):
        for text in (effect.effect, effect.where, effect.quantity, effect.law, *effect.values):
            if text:
                yield text, f"a text of effects[{k}]", LONGEST_TEXT
