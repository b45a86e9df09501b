"""Commands that evaluate recordings: fit and diagnose, and lists of the available fitters, effects and materials."""
