"""The daemon process: owns the analyzer and the journal, answers requests, publishes events."""
