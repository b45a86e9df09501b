"""Analyzers and recordings: the 4294A over VISA, files of other instruments."""

from .visa.resources import open_analyzer

__all__ = ["open_analyzer"]
