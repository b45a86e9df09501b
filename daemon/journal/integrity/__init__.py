"""Whether a journal is what it was: the audit trail, seals, verification of the chain, and repair."""
