"""Physics outside the catalogue: its place and its law."""
