"""Another analyzer's language on the same bench: the SCPI of the Keysight E4990A."""
