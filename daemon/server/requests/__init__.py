"""From a request on the socket to its reply."""
