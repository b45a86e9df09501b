"""Data checks that run before any physics is blamed, one check per module; `gate` runs them all."""
