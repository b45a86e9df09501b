"""Where model and recording differ: which physics was left out, how sure that is, and what would decide."""
