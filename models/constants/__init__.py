"""Material constants: conversions, tensors, passivity, causal losses."""
