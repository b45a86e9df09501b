"""The two-dimensional disk: full 6mm constants in r and z, and a reduced model of it that is fast enough to fit."""
