"""Publishing of events: first written to the journal, then sent."""
