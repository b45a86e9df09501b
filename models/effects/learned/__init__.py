"""Physics outside the catalogue: corrections as functions of frequency, and their laws."""
