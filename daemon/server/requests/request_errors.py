"""Why a request is not met."""

from ....models.base.errors import PzctlError
from ...wire.replies import ErrorBody


class RequestError(PzctlError):
    """A request that cannot be met; carries what the answer says."""

    def __init__(self, code: str, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.problem = ErrorBody(code, message, hint)
