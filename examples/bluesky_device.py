"""A device for Bluesky's run engine: `trigger` begins a measurement, `read` returns its results.

Bluesky requires methods, not a base class, so this file does not import Bluesky. In a plan:

    transducer = Transducer("transducer", read_build("build.toml"), "disk")
    RE(bluesky.plans.scan([transducer], chamber, 20, 40, 5))
"""

import threading
import time
from collections.abc import Callable
from typing import Any

from pzctl import Build, connect
from pzctl.models.base.errors import PzctlError


class Status:
    """The status returned by `trigger`: done or not, with success or failure (Bluesky's Status protocol)."""

    def __init__(self) -> None:
        self._done = threading.Event()
        self._callbacks: list[Callable[[Status], None]] = []
        self._lock = threading.Lock()
        self._error: PzctlError | None = None

    @property
    def done(self) -> bool:
        """Whether it has ended."""
        return self._done.is_set()

    @property
    def success(self) -> bool:
        """Whether it has ended well."""
        return self.done and self._error is None

    def exception(self, timeout: float | None = 0.0) -> PzctlError | None:
        """Return the error, or None; waits `timeout` seconds. Raises TimeoutError."""
        if not self._done.wait(timeout):
            raise TimeoutError("the measurement has not ended yet")
        return self._error

    def add_callback(self, callback: "Callable[[Status], None]") -> None:
        """Call `callback` when it has ended, or at once if it has already."""
        with self._lock:
            if not self.done:
                self._callbacks.append(callback)
                return
        callback(self)

    def finish(self, error: PzctlError | None) -> None:
        """Mark it as ended."""
        with self._lock:
            self._error = error
            self._done.set()
        for callback in self._callbacks:
            callback(self)


class Transducer:
    """A transducer on the bench: readable, with the fitted constants of one step as its values."""

    parent = None

    def __init__(self, name: str, build: Build, step: str, fitter: str = "mason") -> None:
        self.name = name
        self._build, self._step, self._fitter = build, step, fitter
        self._values: dict[str, tuple[float, str]] = {}
        self._time = 0.0

    def trigger(self) -> Status:
        """Measure and fit in a separate thread."""
        status = Status()
        threading.Thread(target=self._measure, args=(status,), daemon=True).start()
        return status

    def read(self) -> dict[str, dict[str, Any]]:
        """Return the results of the last measurement."""
        return {name: {"value": value, "timestamp": self._time} for name, (value, _) in self._values.items()}

    def describe(self) -> dict[str, dict[str, Any]]:
        """Return the description of `read`, with units."""
        source = f"pzctl:{self._build.name}/{self._step}/{self._fitter}"
        return {
            name: {"source": source, "dtype": "number", "shape": [], "units": unit}
            for name, (_, unit) in self._values.items()
        }

    def read_configuration(self) -> dict[str, dict[str, Any]]:
        """Return nothing: the journal has the settings of every sweep."""
        return {}

    describe_configuration = read_configuration

    def _measure(self, status: Status) -> None:
        try:
            with connect() as lab:
                result = lab.fit(lab.measure(self._build, self._step).id, self._fitter)
        except PzctlError as error:
            status.finish(error)
            return
        self._time = time.time()
        constants = {f"{self.name}-{name}".replace(".", "_"): one for name, one in result.constants.items()}
        self._values = {f"{name}_re": (one.re, one.unit) for name, one in constants.items()}
        self._values |= {f"{name}_im": (one.im, one.unit) for name, one in constants.items() if one.im}
        status.finish(None)
