"""Inference: the probability of each explanation, and the effects that could stay undetected."""
