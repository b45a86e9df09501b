"""Files that a person edits (build, materials, configuration), and the paths of the data folder."""
