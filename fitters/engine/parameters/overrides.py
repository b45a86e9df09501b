"""A user's changes of a build for one fit: constants held, tied, bounded, or given a prior."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from ....models.build import Build, LayerSpec, LoadSpec, Quantity
from ...interface import TaskError
from .assembly import BOLT_STIFFNESS, ELASTIC_CONSTANTS, PIEZO_CONSTANTS, ground_name

_GIVEN = "build.toml"
_LOSS_SIGN = {"c33D": 1, "eps33S": -1}
_RADIAL = ("s11E", "s12E", "d31", "eps33T")
_EITHER_SIGN = ("h33", "s12E", "d31")
_TIED = (*ELASTIC_CONSTANTS, "thickness")


@dataclass(frozen=True)
class Amendments:
    """Changes of the build file; names as in the answer (`ml1.z`, `area`, `disk.c33D.loss`), SI."""

    hold: tuple[str, ...] = ()
    tie: tuple[tuple[str, str], ...] = ()
    """Pairs of a constant and the one that it should equal."""
    prior: tuple[tuple[str, float, float], ...] = ()
    """Name, value, standard uncertainty."""
    bound: tuple[tuple[str, float, float], ...] = ()
    """Name, lowest, highest."""


def amended(build: Build, wanted: Amendments) -> Build:
    """Return the build with these changes. Raises TaskError for an unknown name or an impossible value."""
    for name, value, u in wanted.prior:
        build = _with_prior(build, name, value, u)
    for name, low, high in wanted.bound:
        build = _edited(build, name, f"bound {name!r}", lambda q, n=name, a=low, b=high: _bounded(q, n, a, b))
    for name in wanted.hold:
        build = _edited(build, name, f"hold {name!r}", _held)
    for name, leader in wanted.tie:
        build = _tied(build, name, leader)
    return build


def known(build: Build) -> dict[str, Quantity]:
    """Return the build's value and uncertainty of every constant that a fit can free, by full name."""
    quantities = {"area": build.area, "back.z": build.back.z, "front.z": build.front.z}
    for layer in build.layers:
        names = (*PIEZO_CONSTANTS, "density") if layer.kind == "piezo" else ELASTIC_CONSTANTS
        names += tuple(name for name in _RADIAL if name in layer.values)
        quantities |= {f"{layer.name}.{name}": layer.values[name] for name in (*names, "thickness")}
    if build.bolt is not None:
        quantities[BOLT_STIFFNESS] = build.bolt.stiffness
    for step in build.steps:
        quantities |= {ground_name(layer, step.name): thickness for layer, thickness in step.reground.items()}
    return quantities


def _held(quantity: Quantity) -> Quantity:
    return replace(quantity, u=0.0, u_im=0.0, source=_GIVEN, bounds=None, same_as=None)


def _bounded(quantity: Quantity, name: str, low: float, high: float) -> Quantity:
    if not low < quantity.re < high:
        raise TaskError(f"cannot bound {name!r}: its start value {quantity.re:g} is not between {low:g} and {high:g}")
    if low <= 0 and not name.endswith(_EITHER_SIGN):
        raise TaskError(f"cannot bound {name!r} by {low:g}: its lowest value is positive")
    return replace(quantity, bounds=(low, high))


def _with_prior(build: Build, name: str, value: float, u: float) -> Build:
    if not u > 0:
        raise TaskError(f"prior of {name!r}: its uncertainty is {u:g}; a positive one is needed, or hold the constant")
    bare = name.removesuffix(".loss")
    constant = bare.rpartition(".")[2]
    if value <= 0 and constant not in _EITHER_SIGN:
        raise TaskError(f"prior of {name!r}: {value:g} is given; a positive number is needed")
    if name == bare:
        return _edited(
            build, name, f"set a prior on {name!r}", lambda q: replace(q, re=value, u=u, source=_GIVEN, same_as=None)
        )
    sign = _LOSS_SIGN.get(constant)
    if sign is None:
        raise TaskError(f"cannot set a prior on {name!r}: only {' and '.join(_LOSS_SIGN)} have one loss of their own")
    return _edited(
        build,
        bare,
        f"set a prior on {name!r}",
        lambda q: replace(q, im=sign * value * q.re, u_im=u * q.re, source=_GIVEN),
    )


def _tied(build: Build, name: str, leader: str) -> Build:
    """Return the build with `name` tied to `leader`."""
    there, what = known(build), f"tie {name!r} to {leader!r}"
    for constant in (name, leader):
        if constant not in there:
            raise TaskError(f"cannot {what}: {_these(build)}")
    kinds = name.rpartition(".")[2], leader.rpartition(".")[2]
    if kinds[0] != kinds[1] or kinds[0] not in _TIED or name == leader or "area" in kinds:
        raise TaskError(f"cannot {what}: two of one kind are needed, of {', '.join(_TIED)}, in different layers")
    if any(constant.startswith(("back.", "front.")) for constant in (name, leader)):
        raise TaskError(f"cannot {what}: loads cannot be tied")
    if there[leader].same_as is not None or any(quantity.same_as == name for quantity in there.values()):
        raise TaskError(f"cannot {what}: one of them is tied already; tie all to one that is not tied")
    return _edited(build, name, what, lambda _: replace(there[leader], same_as=leader))


def _these(build: Build) -> str:
    return f"this build has {', '.join(sorted(known(build)))}"


def _edited(build: Build, name: str, what: str, edit: Callable[[Quantity], Quantity]) -> Build:
    """Return the build with one of its constants edited, together with all that are tied to it. Raises TaskError."""
    there = known(build)
    if name not in there:
        raise TaskError(f"cannot {what}: {_these(build)}")
    leader = there[name].same_as
    if leader is not None and name.rpartition(".")[2] in PIEZO_CONSTANTS:
        raise TaskError(f"cannot {what}: the build ties it to {leader} with the whole ceramic; name that")
    new = edit(there[name])
    changed = {name: new} | {
        follower: replace(new, same_as=name) for follower, quantity in there.items() if quantity.same_as == name
    }
    return _with(build, changed)


def _with(build: Build, changed: Mapping[str, Quantity]) -> Build:
    """Return the build with these constants. An edited load is no longer called air, since its value was given."""

    def layer(spec: LayerSpec) -> LayerSpec:
        return replace(spec, values={k: changed.get(f"{spec.name}.{k}", q) for k, q in spec.values.items()})

    def load(side: str, old: LoadSpec) -> LoadSpec:
        return LoadSpec("given", changed[f"{side}.z"]) if f"{side}.z" in changed else old

    return replace(
        build,
        area=changed.get("area", build.area),
        layers=tuple(map(layer, build.layers)),
        bolt=build.bolt and replace(build.bolt, stiffness=changed.get(BOLT_STIFFNESS, build.bolt.stiffness)),
        back=load("back", build.back),
        front=load("front", build.front),
        steps=tuple(
            replace(step, reground={k: changed.get(ground_name(k, step.name), q) for k, q in step.reground.items()})
            for step in build.steps
        ),
    )
