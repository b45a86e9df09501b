"""Errors that are shown to users. Every other exception is a defect of pzctl."""


class PzctlError(Exception):
    """One sentence for the user: what, where, what was found, what is allowed. The command line exits with 2."""

    exit_status = 2


class CannotError(PzctlError):
    """A valid request without a possible result. The command line exits with 1."""

    exit_status = 1
