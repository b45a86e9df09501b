"""The physics alone: sweeps, materials, layers, stacks, resonators. Knows no file, socket or screen."""
