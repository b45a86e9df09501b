"""Analyzers and recordings: the 4294A over VISA, files of other instruments."""
