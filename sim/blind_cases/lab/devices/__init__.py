"""Random specimens and their wiring, with all their flaws, and their electrical response."""
