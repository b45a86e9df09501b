"""The simulated 4294A and the virtual bench behind it."""
