"""Commands that run the lab: daemon, simulator, fixture compensation, keys, self-test, screenshots."""
