"""The 4294A's settings, replies, error queue and status."""
