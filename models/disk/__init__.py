"""A bare round disk: radial mode, and radial and thickness mode together."""
