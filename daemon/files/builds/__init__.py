"""Build files: one transducer with its layers and gluing steps, read from `build.toml`."""
