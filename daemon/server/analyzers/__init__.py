"""The analyzers that a daemon owns: their threads, queues, limits, and simulated ones."""
