"""What must be right with the data before any physics is blamed, one gate a module; `gate` runs them all."""
