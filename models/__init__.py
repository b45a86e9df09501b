"""Physics without input or output: sweeps, materials, layers, stacks, resonators. Uses no file, socket or screen."""
