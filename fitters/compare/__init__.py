"""What changed between two recordings of a device, with no model of the device needed."""
