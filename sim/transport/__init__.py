"""Ways to the simulated analyzer: raw socket, GPIB adapter, FTP, and faults on the way."""
