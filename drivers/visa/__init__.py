"""VISA: resource strings, sessions, and the line to one instrument."""
