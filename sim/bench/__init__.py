"""The virtual bench: devices under test, gluing steps, jig, hidden effects."""
