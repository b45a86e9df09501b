"""The verdict of a comparison and what it reports."""
