"""Files that a person edits: configuration and its defaults, and where everything lies."""
