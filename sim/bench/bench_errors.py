"""The error of the virtual bench, in a module of its own so that clients of the bench need not import the physics."""

from ...models.base.errors import PzctlError


class BenchError(PzctlError):
    """A command that the bench does not know or cannot do."""
