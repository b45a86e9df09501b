"""Faults on demand between instrument and computer, at a chosen exchange.

An exchange is one program message that reaches the instrument. A fault is armed for exchange number `at`; 1 is the
next one. A fault of an answer strikes the first suitable answer from that exchange on.
"""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from ..bench.bench_errors import BenchError

AT_MESSAGE = {
    "hang": "nobody answers for `seconds`, or until the faults are cleared",
    "ignore": "the message is swallowed",
    "drop": "the connection is closed after the message is carried out",
    "power-cycle": "mains fails, in the middle of the sweep where one runs; back after `seconds`",
    "meddle": "somebody at the front panel does `message`, in the middle of the sweep where one runs",
}
"""Faults that strike a message."""

AT_ANSWER = {
    "cut": "half of the answer comes, then silence",
    "garbage": "bytes that mean nothing come before the answer",
    "wrong-count": "the block's header counts `bytes` too many or too few",
}
"""Faults that strike an answer."""

LASTING = {
    "polarity": "impedance comes with the opposite sign",
    "dead-clock": "the date of saved files is nonsense",
    "bias-overload": "DCO ON answers with error 137",
    "no-list": "the commands that edit the list-sweep table are undefined headers",
}
"""Faults that last until they are cleared."""

GARBAGE = b"\x13\xfe*ABC7,"


@dataclass(frozen=True)
class Fault:
    """One armed fault."""

    kind: str
    at: int
    """Number of the exchange, counted from the start of the simulator."""
    seconds: float = 0.0
    message: str = "POIN 77"
    bytes: int = -8


@dataclass
class Faults:
    """The armed faults, and the count of exchanges."""

    exchanges: int = 0
    armed: list[Fault] = field(default_factory=list[Fault])
    struck: list[str] = field(default_factory=list[str])
    """Kinds that have struck since the faults were cleared, oldest first."""
    _awake: asyncio.Event = field(default_factory=asyncio.Event)
    _end_of_hang: asyncio.TimerHandle | None = None

    def __post_init__(self) -> None:
        self._awake.set()

    def arm(self, kind: str, at: int = 1, options: Mapping[str, float | str] | None = None) -> None:
        """Arm a fault at the `at`-th exchange from now. Raises BenchError for an unknown kind or number."""
        kinds = {**AT_MESSAGE, **AT_ANSWER}
        if kind not in kinds:
            raise BenchError(f"fault: no kind {kind!r}; there are {', '.join([*kinds, *LASTING, 'none'])}")
        if at < 1:
            raise BenchError(f"fault: at is {at}; exchanges are counted from 1, the next one")
        chosen = dict(options or {})
        self.armed.append(
            Fault(
                kind,
                self.exchanges + at,
                float(chosen.get("seconds", 3600.0 if kind == "hang" else 0.2)),
                str(chosen.get("message", "POIN 77")),
                int(chosen.get("bytes", -8)),
            )
        )

    def clear(self) -> None:
        """Disarm everything and end a hang."""
        self.armed.clear()
        self.struck.clear()
        self._awake.set()

    def next_exchange(self) -> list[Fault]:
        """Count a message, and remove and return the faults that strike it."""
        self.exchanges += 1
        due = [f for f in self.armed if f.kind in AT_MESSAGE and f.at <= self.exchanges]
        for fault in due:
            self.armed.remove(fault)
            self.struck.append(fault.kind)
        return due

    def spoiled(self, answer: bytes) -> tuple[bytes, Literal["cut", ""]]:
        """Return the bytes to send for an answer (with its newline), and `cut` if nothing may follow."""
        cut: Literal["cut", ""] = ""
        for fault in [f for f in self.armed if f.kind in AT_ANSWER and f.at <= self.exchanges]:
            is_block = answer[:2] == b"#6"
            if fault.kind == "wrong-count" and not is_block:
                continue
            self.armed.remove(fault)
            self.struck.append(fault.kind)
            if fault.kind == "cut":
                answer, cut = answer[: len(answer) // 2], "cut"
            elif fault.kind == "garbage":
                answer = GARBAGE + answer
            else:
                answer = b"#6%06d" % max(0, int(answer[2:8]) + fault.bytes) + answer[8:]
        return answer, cut

    def hang(self, seconds: float) -> None:
        """Hold back every answer for this time."""
        self._awake.clear()
        if self._end_of_hang is not None:
            self._end_of_hang.cancel()
        self._end_of_hang = asyncio.get_running_loop().call_later(seconds, self._awake.set)

    async def while_hanging(self) -> None:
        """Wait until no hang is in force."""
        await self._awake.wait()
