"""The analyzer's command language: messages, commands, data formats, files."""
