"""Base of the effects: the device that they change, and the laws and loads that they modify."""
