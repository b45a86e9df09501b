"""The Keysight E4990A impedance analyzer over its raw socket or any other VISA path."""
