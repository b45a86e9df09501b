"""What an analyzer is, whichever it is."""
