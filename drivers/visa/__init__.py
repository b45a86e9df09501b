"""VISA: resource strings, sessions, and the connection to one instrument."""
