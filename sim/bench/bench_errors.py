"""What the virtual bench says no with; apart from the physics, so that who only asks the bench need not load it."""

from ...models.base.errors import PzctlError


class BenchError(PzctlError):
    """A command that the bench does not know or cannot do."""
