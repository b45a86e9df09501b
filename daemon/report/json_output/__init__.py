"""Results as JSON objects, for `--json` and for the wire."""
