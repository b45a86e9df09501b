"""The off-machine backup of a folder journal: one copy that is brought up to date and read back each time."""
