"""The error that refuses a request."""

from ....models.base.errors import PzctlError
from ...wire.replies import ErrorBody


class RequestError(PzctlError):
    """A request is refused; `problem` is the answer's error object."""

    def __init__(self, code: str, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.problem = ErrorBody(code, message, hint)
