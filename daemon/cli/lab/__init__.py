"""Commands that run the lab: the daemon, the simulator, fixture compensation, keys, self-test."""
