"""Integrity of a journal: the audit trail, seals, verification of the chain, and repair."""
