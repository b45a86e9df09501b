"""Analyzers and recordings: instruments over VISA, files of theirs and of others."""

from .analyzers import capabilities_of, open_analyzer

__all__ = ["capabilities_of", "open_analyzer"]
