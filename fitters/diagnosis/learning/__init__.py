"""Physics outside the catalogue: at which place it acts, and which law it follows."""
