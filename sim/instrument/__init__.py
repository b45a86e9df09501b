"""The simulated analyzer: its settings, sweep, status, correction and accuracy."""
