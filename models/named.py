"""Parameters by name: what every model does with a name it does not have."""

from collections.abc import Mapping, Sequence


def require(names: Sequence[str] | Mapping[str, float], known: Mapping[str, float], who: str) -> None:
    """Raise KeyError, which says what there is, for a name that is not in `known`."""
    for name in names:
        if name not in known:
            raise KeyError(f"{who} has no parameter {name!r}; it has {', '.join(known)}")
