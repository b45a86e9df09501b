"""The user's own effects: laws learned from recordings, with names, in the folder `effects` of the data folder.

Each is a file NAME.toml with the section [[effects]] that `pzctl diagnose --learn` writes to a build. They stand beside
the effects of the catalogue in every diagnosis.
"""

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import platformdirs

from ..models.base.errors import PzctlError
from ..models.base.names import among
from ..models.effects import Effect, EffectError, EffectParameter, catalogue
from ..models.effects.learned.corrections import Place, Quantity
from ..models.effects.learned.laws import Law
from ..models.effects.learned.learned import NAME as LEARNED
from ..models.effects.learned.learned import find_law, law_name
from ..models.effects.learned.user_law import UserLaw, law_parameters
from .data_folder import chosen_folder, user_effects_folder
from .engine.parameters.known_effects import parameter_key

_WORDS = ("effect", "where", "quantity", "law")
_REFERENCE = "reference_Hz"
_KEYS = (*_WORDS, _REFERENCE, "steps")
_NAMES = re.compile(r"[a-z][a-z0-9-]{0,39}")
_TAKEN = (LEARNED, "unknown", "finite-diameter", "fixture-residual")
"""Names with another meaning in a diagnosis."""
_ONLY_FOUND = {
    LEARNED: "is a law that `pzctl diagnose --learn` finds in recordings, not one of the list: what was found says it",
    "unknown": "stands for what no effect of the list explains: `pzctl diagnose --learn` looks for its law",
}
"""Names of findings that are no effects of a list."""
_WHERE: Mapping[str, str] = {
    "stiffness": "layer:NAME",
    "permittivity": "layer:NAME",
    "coupling": "layer:NAME",
    "compliance": "interface:A|B",
    "inertia": "interface:A|B",
    "impedance": "face:back or face:front",
    "load": "face:back or face:front",
    "series": "terminals",
    "shunt": "terminals",
}
_FORMS = {
    "layer:NAME": r"layer:[^|:]+",
    "interface:A|B": r"interface:[^|:]+\|[^|:]+",
    "face:back or face:front": r"face:(back|front)",
    "terminals": r"terminals",
}


class UserEffectError(EffectError):
    """An effect that cannot be taken into the user's catalogue, or a file there that cannot be read."""


@dataclass(frozen=True)
class _Section:
    """A section [[effects]] of a file."""

    data: Mapping[str, Any]
    at: str
    """The file and the section, for messages."""

    def error(self, says: str) -> UserEffectError:
        return UserEffectError(f"{self.at}: {says}")


def every_effect() -> tuple[Effect, ...]:
    """Return the effects of the catalogue and the user's own, sorted by name. Raises EffectError."""
    return tuple(sorted((*catalogue(), *user_effects()), key=lambda effect: effect.name))


def find_any_effect(name: str) -> Effect:
    """Return the effect with this name, of the catalogue or of the user. Raises EffectError."""
    known = {effect.name: effect for effect in every_effect()}
    if name in _ONLY_FOUND:
        raise EffectError(f"effect {name!r} {_ONLY_FOUND[name]}")
    if name not in known:
        raise EffectError(f"effect {name!r} is not known; {among(name, list(known))}")
    return known[name]


def user_effects() -> tuple[UserLaw, ...]:
    """Return the user's own effects, sorted by name. Raises UserEffectError for a file that cannot be read."""
    try:
        return tuple(_kept(file) for file in sorted(_folder().glob("*.toml")))
    except UserEffectError as error:
        raise UserEffectError(f"{error}; correct the file or delete it") from None


def add_user_effects(file: Path, name: str | None = None) -> tuple[tuple[UserLaw, Path], ...]:
    """Take the learned laws of a file, a build or its sections [[effects]] alone, into the user's catalogue.

    `name`: of the only law of the file; without it, each has the name of what it corrects and of its law. Returns each
    with its new file. Raises UserEffectError, and changes nothing then.
    """
    learned = [one for one in _sections(file) if one.data.get("effect") == LEARNED]
    if not learned:
        raise UserEffectError(f"{file}: no section [[effects]] has effect = \"{LEARNED}\"; `pzctl diagnose --learn` "
                              "writes such a section to a build")  # fmt: skip
    if name is not None and len(learned) > 1:
        raise UserEffectError(f"{file}: {len(learned)} laws were learned, and {name!r} can be the name of one only")
    laws = [_law(one, name) for one in learned]
    folder = _folder()
    taken = {effect.name for effect in every_effect()}
    for law in laws:
        if law.name in taken:
            raise UserEffectError(f"the catalogue has an effect {law.name!r} already; give another name after the file")
        taken.add(law.name)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        return tuple((law, _written(folder / f"{law.name}.toml", law)) for law in laws)
    except OSError as error:
        raise UserEffectError(f"{folder}: the effect cannot be written: {error.strerror or error}") from None


def remove_user_effect(name: str) -> Path:
    """Delete a user's own effect, also if its file cannot be read; return the file. Raises UserEffectError."""
    files = {file.stem: file for file in _folder().glob("*.toml")}
    if name not in files:
        if name in {effect.name for effect in catalogue()}:
            raise UserEffectError(f"effect {name!r} is part of pzctl; only effects of your own can be removed")
        there = among(name, list(files)) if files else "there is none"
        raise UserEffectError(f"effect {name!r} is none of your own; {there}")
    try:
        files[name].unlink()
    except OSError as error:
        raise UserEffectError(f"{files[name]} cannot be deleted: {error.strerror or error}") from None
    return files[name]


def _folder() -> Path:
    return user_effects_folder(chosen_folder() or platformdirs.user_data_path("pzctl", appauthor=False))


def _kept(file: Path) -> UserLaw:
    """Return the law of a file of the user's catalogue."""
    sections = list(_sections(file))
    if len(sections) != 1:
        raise UserEffectError(f"{file}: {len(sections)} sections [[effects]]; there must be one")
    return _law(sections[0], file.stem)


def _sections(file: Path) -> Iterable[_Section]:
    try:
        data = tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise UserEffectError(f"{file} cannot be read: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserEffectError(f"{file} is no TOML file: {error}") from None
    found = data.get("effects", [])
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in cast("list[object]", found)):
        raise UserEffectError(f"{file}: effects is no list of sections; write [[effects]] above each")
    sections = cast("list[dict[str, Any]]", found)
    return [_Section(data, f"{file}: effects[{k}]") for k, data in enumerate(sections)]


def _law(section: _Section, name: str | None) -> UserLaw:
    """Return the law of a section. Raises UserEffectError."""
    place, law = _place_and_law(section)
    if _REFERENCE not in section.data:
        raise section.error(
            f"{_REFERENCE} is missing, the frequency at which the law has its size; `pzctl diagnose --learn` writes it"
        )
    reference = _number(section, _REFERENCE, section.data[_REFERENCE])
    if reference <= 0:
        raise section.error(f"{_REFERENCE} is {reference:g}; a frequency above 0 is needed")
    knobs = {parameter_key(knob): knob for knob in law_parameters(place, law, reference)}
    for key in section.data:
        if key not in _KEYS and key not in knobs:
            raise section.error(f"{key} is not a known key; {among(key, [*_KEYS, *knobs])}")
    values = {knob.name: _quantity(section, key, knob) for key, knob in knobs.items()}
    chosen = name or law_name(place, law)
    if not _NAMES.fullmatch(chosen) or chosen in _TAKEN:
        raise section.error(
            f"the name {chosen!r} cannot be used; allowed are up to 40 small letters, digits and hyphens, a letter "
            f"first, and none of {', '.join(_TAKEN)}"
        )
    return UserLaw(chosen, place, law, reference, values)


def _place_and_law(section: _Section) -> tuple[Place, Law]:
    effect, where, quantity, law = (_word(section, key) for key in _WORDS)
    if effect != LEARNED:
        raise section.error(f'effect is {effect!r}; an effect of your own is a law with effect = "{LEARNED}"')
    if quantity not in _WHERE:
        raise section.error(f"quantity is {quantity!r}; {among(quantity, _WHERE)}")
    form = _WHERE[quantity]
    if not re.fullmatch(_FORMS[form], where):
        raise section.error(f"where is {where!r}; the place of a law of {quantity} is {form}")
    place = Place(where, cast("Quantity", quantity))
    try:
        return place, find_law(place, law)
    except PzctlError as error:
        raise section.error(str(error)) from None


def _word(section: _Section, key: str) -> str:
    value = section.data.get(key)
    if not isinstance(value, str):
        raise section.error(f"{key} is {value!r}; a text is needed" if key in section.data else f"{key} is missing")
    return value


def _number(section: _Section, key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise section.error(f"{key} is {value!r}; a number is needed")
    return float(value)


def _quantity(section: _Section, key: str, knob: EffectParameter) -> tuple[float, float]:
    """Return value and uncertainty of a parameter, a number or { value = ..., u = ... }."""
    given = section.data.get(key)
    table = cast("dict[str, object]", given) if isinstance(given, dict) else {"value": given}
    if given is None or "value" not in table or set(table) - {"value", "u"}:
        found = "is missing" if given is None else f"has {', '.join(table) or 'nothing'}"
        raise section.error(f"{key} {found}; write {key} = {{ value = ..., u = ... }}")
    value, u = _number(section, key, table["value"]), _number(section, f"{key}.u", table.get("u", 0.0))
    if not knob.lower <= value <= knob.upper or value <= 0 or u < 0:
        raise section.error(
            f"{key} is {value:g} with u = {u:g}; allowed is {knob.lower:g} to {knob.upper:g}, above 0, and a u that is "
            "not negative"
        )
    return value, u


def _written(file: Path, law: UserLaw) -> Path:
    """Write a law to a file of the user's catalogue."""
    lines = [
        "[[effects]]",
        f'effect = "{LEARNED}"',
        f'where = "{law.place.where}"',
        f'quantity = "{law.place.quantity}"',
        f'law = "{law.law.name}"',
        f"{_REFERENCE} = {law.reference:.9g}",
    ]
    for knob in law_parameters(law.place, law.law, law.reference):
        value, u = law.values[knob.name]
        lines.append(f"{parameter_key(knob)} = {{ value = {value:.9g}, u = {u:.3g} }}")
    new = file.with_name(f"{file.name}.new")
    new.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return new.replace(file)
