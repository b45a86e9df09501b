"""Names: validation, safe display of names from outside, and hints for unknown names."""

import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import SequenceMatcher

from .errors import PzctlError


def require(names: Sequence[str] | Mapping[str, float], known: Mapping[str, float], who: str) -> None:
    """Raise KeyError, with the available names, for a name that is not in `known`."""
    for name in names:
        if name not in known:
            raise KeyError(f"{who} has no parameter {name!r}; it has {', '.join(known)}")


def among(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence on an unknown name: the available names, and the closest one if it is similar."""
    names = list(known)
    near = likely_meant(name, names)
    return f"there are {', '.join(names) or 'none'}" + (f"; did you mean {near[0]!r}?" if near else "")


_LEAST_LIKENESS = 0.65
"""Share of letters in common: one wrong letter of three, or two of six, may be a slip of the hand."""
_LONGEST_SLIP = 200
"""Characters of a name beyond which none is looked for: it takes seconds for the megabyte that a request may have."""
_LEAST_PART = 3
"""Letters of a name that may be a part of the one meant, which lacks its unit or its number."""


def likely_meant(name: str, known: Iterable[str], most: int = 1) -> list[str]:
    """Return at most `most` known names of which `name` may be a misspelling or a part, the most similar first.

    Case, blanks and punctuation do not matter.
    """
    if len(name) > _LONGEST_SLIP:
        return []
    given = bare(name)
    likeness: dict[str, float] = {}
    for other in known:
        plain = bare(other)
        ratio = SequenceMatcher(None, plain, given).ratio()
        shorter, longer = sorted((plain, given), key=len)
        if ratio >= _LEAST_LIKENESS or (len(shorter) >= _LEAST_PART and shorter in longer):
            likeness[other] = ratio
    return sorted(likeness, key=lambda other: -likeness[other])[:most]


def bare(name: str) -> str:
    """Return the letters and digits of a name, in one case."""
    return "".join(letter for letter in name.casefold() if letter.isalnum())


LONGEST_NAME = 64
"""Characters allowed in the name of a sample, a step, a fitter or a client."""


class NameFault(PzctlError):
    """A name that is empty or cannot be shown on one line."""


def check_name(name: str, what: str, longest: int = LONGEST_NAME) -> str:
    """Return the name of a sample, step, layer, fitter, client or person if it is valid. Raises NameFault.

    It can be printed, so that it changes neither a terminal nor a log nor a table, and has neither too many
    characters nor blanks around it. `what` is what the sentence calls it.
    """
    if not name:
        raise NameFault(f"{what} is empty; a name is needed")
    if len(name) > longest:
        raise NameFault(f"{what} has {len(name)} characters; at most {longest} are allowed")
    bad = next((c for c in name if not c.isprintable()), None)
    if bad is not None:
        raise NameFault(f"{what} is {name!a}; characters that cannot be printed, such as {bad!a}, are not allowed")
    if name != name.strip():
        raise NameFault(f"{what} is {name!r}; blanks before or behind a name are not allowed")
    return name


def shown(text: str, keep: str = "") -> str:
    r"""Return text from outside in printable form: other characters become `\x1b`; those in `keep` remain."""
    return "".join(c if c.isprintable() or c in keep else ascii(c)[1:-1] for c in text)


_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
"""Names that Windows keeps for devices, in every folder and with every extension."""


def as_file_name(*names: str) -> str:
    """Return names from outside, joined by `-`, as one safe component of a path."""
    name = "-".join(re.sub(r"[^\w +.,=@-]", "_", name) for name in names).lstrip(".").rstrip(" .") or "_"
    return f"_{name}" if _DEVICE.fullmatch(name) else name


def numbered(name: str, number: int) -> str:
    """Return the name of the one with this number among several of the same name: `learned`, `learned-2`."""
    return name if number == 1 else f"{name}-{number}"
