"""What is tried: effects of the catalogue at each place, and artefacts of the instrument."""
