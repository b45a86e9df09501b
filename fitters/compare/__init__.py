"""Comparison of two recordings of a device: what changed, without a model of the device."""
