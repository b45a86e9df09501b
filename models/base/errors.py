"""The errors that people read. Every other exception is a defect of ours."""


class PzctlError(Exception):
    """One sentence for a person: what, where, what was found, what is allowed. The command line exits with 2."""

    exit_status = 2


class CannotError(PzctlError):
    """The question was right and the answer is "it cannot be done". The command line exits with 1."""

    exit_status = 1
