"""The URL of a journal on a database server, as it may be shown: in settings, sentences and logs."""

import re
from urllib.parse import unquote

_AUTHORITY = re.compile(r"(?:[\w.%-]*|\[[0-9A-Fa-f:.%]*\])(?::\d*)?", re.ASCII)
"""A host, and a port or none; with commas between, several."""

_SECRET = re.compile("pass|secret|token|key", re.IGNORECASE)


def without_password(url: str) -> str:
    """Return a URL with `***` for its password, wherever that stands; anything else, as a folder, is returned as it is.

    What cannot be told from a password, as the parts of one that holds `/`, `?` or `#` as they are, is not shown.
    """
    scheme, colons, rest = url.partition("://")
    if not colons:
        return url
    rest, question, query = rest.partition("?")
    before, at, place = rest.rpartition("@")
    user, colon, _ = before.partition(":")
    authority, slash, database = place.partition("/")
    if not all(_AUTHORITY.fullmatch(one) for one in authority.split(",")) or "@" in query:
        return f"{scheme}://***"
    who = user + (":***" if colon else "") + at
    shown = [_parameter(one) for one in query.split("&")]
    return f"{scheme}://{who}{authority}{slash}{database}{question}{'&'.join(shown)}"


def _parameter(one: str) -> str:
    """Return `key=value` of a query, without a value that is secret; `%70assword` is `password` to the server."""
    key, equals, _ = one.partition("=")
    return f"{key}=***" if equals and _SECRET.search(unquote(key)) else one if equals or not one else "***"
