"""The hypotheses: catalogue effects at each possible place, and artefacts of the instrument."""
