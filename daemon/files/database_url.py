"""The URL of a journal on a database server without its password, for settings, messages and logs."""

import re
from urllib.parse import unquote

_AUTHORITY = re.compile(r"(?:[\w.%-]*|\[[0-9A-Fa-f:.%]*\])(?::\d*)?", re.ASCII)
"""A host with an optional port."""

_SECRET = re.compile("pass|secret|token|key", re.IGNORECASE)


def without_password(url: str) -> str:
    """Return a URL with `***` in place of its password; return anything else, such as a folder, unchanged.

    Parts that may belong to a password with an unescaped `/`, `?` or `#` are hidden too.
    """
    scheme, colons, rest = url.partition("://")
    if not colons:
        return url
    rest, question, query = rest.partition("?")
    before, at, place = rest.rpartition("@")
    user, colon, _ = before.partition(":")
    authority, slash, database = place.partition("/")
    if not all(_AUTHORITY.fullmatch(host) for host in authority.split(",")) or "@" in query:
        return f"{scheme}://***"
    who = user + (":***" if colon else "") + at
    shown = [_parameter(parameter) for parameter in query.split("&")]
    return f"{scheme}://{who}{authority}{slash}{database}{question}{'&'.join(shown)}"


def _parameter(parameter: str) -> str:
    """Return `key=value` of a query with a secret value hidden; the server reads `%70assword` as `password`."""
    key, equals, _ = parameter.partition("=")
    if equals and _SECRET.search(unquote(key)):
        return f"{key}=***"
    return parameter if equals or not parameter else "***"
