"""What all models share: array types, errors, names, the model protocol."""
