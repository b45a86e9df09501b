"""Storage of a journal: events in SQLite or PostgreSQL, arrays in files, and the chain of hashes over the rows."""
