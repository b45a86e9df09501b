"""The journal, which keeps every event and every sweep on disk before it is published."""
