"""Requests: reading them from the socket, checking and answering them."""
