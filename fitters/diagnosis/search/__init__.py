"""The search for effects that explain a misfit."""
