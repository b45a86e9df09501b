"""Events: written to the journal, then published."""
