"""The live page: a client of the daemon that serves one web page from its own process."""
