"""The journal: every event and every sweep, kept on disk before anyone hears of it."""
