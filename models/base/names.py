"""Names: what is said of one that is not known."""

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches


def require(names: Sequence[str] | Mapping[str, float], known: Mapping[str, float], who: str) -> None:
    """Raise KeyError, which says what there is, for a name that is not in `known`."""
    for name in names:
        if name not in known:
            raise KeyError(f"{who} has no parameter {name!r}; it has {', '.join(known)}")


def among(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence on a name that is not known: what there is, and what was meant if that is near."""
    names = list(known)
    near = get_close_matches(name, names, n=1)
    return f"there are {', '.join(names) or 'none'}" + (f"; did you mean {near[0]!r}?" if near else "")
