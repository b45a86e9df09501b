"""Which further measurement would decide between explanations."""
