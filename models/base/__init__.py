"""Common base of all models: array types, errors, names, the model protocol."""
