"""Choice of the further measurement that would decide between explanations."""
