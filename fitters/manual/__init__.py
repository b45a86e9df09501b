"""Fits by hand: chosen constants, bands and effects, changed by sliders."""
