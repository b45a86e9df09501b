"""The daemon process, which owns the analyzer and the journal, answers requests and publishes events."""
