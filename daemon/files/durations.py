"""Times as people write them: 30s, 10min, 2h."""

import re

_DURATION = re.compile(r"(\d+(?:[.,]\d+)?) ?(s|min|h)")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


def seconds_of(text: str) -> float | None:
    """Return a time in seconds from `30s`, `1.5h` or `1,5h`; None for anything else."""
    found = _DURATION.fullmatch(text.strip())
    return None if found is None else float(found[1].replace(",", ".")) * _SECONDS[found[2]]
