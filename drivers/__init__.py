"""Analyzers and recordings: instruments over VISA, and files of instruments and other programs."""

from .analyzers import capabilities_of, open_analyzer

__all__ = ["capabilities_of", "open_analyzer"]
