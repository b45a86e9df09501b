"""Changes in a device that a build describes, fitted with the device as it was found: only the change counts."""
