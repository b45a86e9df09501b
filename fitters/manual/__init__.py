"""Fitting by hand: chosen constants, bands and effects, moved by sliders."""
