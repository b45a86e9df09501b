"""The drawn specimens and their wires, with everything that may be wrong with them, and how they respond."""
