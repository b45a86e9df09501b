"""The port of the bench: one JSON object per line in, one out. Layers are glued here, never by the instrument."""

import asyncio
import contextlib
import json
from collections.abc import Callable, Mapping
from typing import Any, cast

from ...models.base.errors import PzctlError
from ...models.base.strict_json import JsonFault, once_each
from ..instrument.instrument import Instrument
from ..model import Model
from ..transport.exchange import InFlight
from ..transport.faults import LASTING, Faults
from .bench_errors import BenchError
from .hidden_effects import hidden, hide
from .jig import JIGS, Jig
from .json_numbers import finite, quoted

LONGEST_PAUSE = 3600.0
"""Seconds that the instrument can be off."""


class BenchPort:
    """Answers the bench's commands."""

    def __init__(
        self,
        instrument: Instrument,
        model: Model,
        faults: Faults,
        in_flight: InFlight,
        power_cycle: Callable[[float], None],
    ) -> None:
        self._instrument, self._bench, self._faults = instrument, instrument.bench, faults
        self._in_flight, self._power_cycle = in_flight, power_cycle
        self._commands: Mapping[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "status": lambda _: {},
            "step": lambda c: self._done(self._bench.glue(_text(c, "name"))),
            "next": lambda _: self._done(self._bench.glue_next()),
            "truth": lambda _: self._truth(),
            "new-sample": lambda c: self._done(self._bench.new_sample(_whole(c, "seed"))),
            "connect": lambda c: self._done(self._bench.connect(_text(c, "what"))),
            "jig": self._jig,
            "effects": self._effects,
            "hidden": self._hidden,
            "fault": self._fault,
            "trigger": lambda _: self._done(self._trigger()),
            "panel": lambda c: self._done(
                model.panel(self._instrument, _text(c, "message").encode("latin-1", "replace"))
            ),
            "power-cycle": lambda c: self._done(self._power_cycle(_pause({"seconds": 0.2, **c}, "seconds"))),
        }

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one client until it disconnects."""
        with contextlib.suppress(ConnectionError):
            while line := await self._line(reader):
                writer.write(json.dumps(self.answer(line)).encode("utf-8") + b"\n")
                await writer.drain()

    async def _line(self, reader: asyncio.StreamReader) -> bytes:
        try:
            return await reader.readline()
        except ValueError:  # the line is longer than the limit; its rest is not a command
            return b""

    def answer(self, line: bytes) -> dict[str, Any]:
        """Return the answer to one line."""
        try:
            command = _parsed(line)
            if not isinstance(command, dict):
                raise BenchError('bench: a JSON object is needed, such as {"command": "status"}')
            self._instrument.advance()
            return {
                "ok": True,
                **self._run({str(k): v for k, v in cast("dict[Any, Any]", command).items()}),
                **self._status(),
            }
        except PzctlError as error:
            return {"ok": False, "error": str(error)}
        finally:
            self._instrument.wake()

    def _run(self, command: dict[str, Any]) -> dict[str, Any]:
        name = command.get("command")
        if not isinstance(name, str) or name not in self._commands:
            raise BenchError(f"bench: no command {name!r}; there are {', '.join(self._commands)}")
        return self._commands[name]({k: v for k, v in command.items() if k != "command"})

    @staticmethod
    def _done(_: None) -> dict[str, Any]:
        return {}

    def _status(self) -> dict[str, Any]:
        bench, sweeper = self._bench, self._instrument.sweeper
        return {
            "seed": bench.seed,
            "step": bench.step,
            "steps": list(bench.sample.steps),
            "layers": list(bench.sample.names(bench.step)),
            "connected": bench.content,
            "bench_seconds": bench.seconds,
            "sweeping": sweeper.running is not None,
            "progress": sweeper.progress(),
            "exchanges": self._faults.exchanges,
            "struck": list(self._faults.struck),
        }

    def _truth(self) -> dict[str, Any]:
        stack = self._bench.sample.stack(self._bench.step)
        area = float(stack.parameters()["area"])
        constants = self._bench.sample.truth()
        jig = vars(self._bench.jig).copy()
        return {"area_m2": area, "constants": constants, "jig": jig, "hidden": hidden(self._bench)}

    def _jig(self, command: dict[str, Any]) -> dict[str, Any]:
        name = command.pop("name", None)
        if name is not None:
            if name not in JIGS:
                raise BenchError(f"bench: no jig {name!r}; there are {', '.join(JIGS)}")
            self._bench.jig = JIGS[name]
        values = {key: _real(command, key) for key in command}
        unknown = sorted(set(values) - set(vars(self._bench.jig)))
        if unknown:
            raise BenchError(f"bench: a jig has no {unknown[0]!r}; it has {', '.join(vars(self._bench.jig))}")
        self._bench.jig = Jig(**{**vars(self._bench.jig), **values})
        return {"jig": vars(self._bench.jig).copy()}

    def _effects(self, command: dict[str, Any]) -> dict[str, Any]:
        wanted = {name: _switch(command, name) for name in ("noise", "off", "radial") if name in command}
        effects = self._bench.effects.changed(command)
        self._bench.check(effects, wanted.get("radial", self._bench.radial))
        for name, on in wanted.items():
            setattr(self._bench, name, on)
        self._bench.effects = effects
        switches = {name: getattr(self._bench, name) for name in ("noise", "off", "radial")}
        return {"effects": vars(self._bench.effects) | switches}

    def _hidden(self, command: dict[str, Any]) -> dict[str, Any]:
        hide(self._bench, command)
        return {"hidden": hidden(self._bench)}

    def _fault(self, command: dict[str, Any]) -> dict[str, Any]:
        kind = _text(command, "kind")
        if kind == "none" or kind in LASTING:
            self._lasting(kind)
        else:
            self._faults.arm(kind, _whole(command, "at") if "at" in command else 1, _options(command))
        return {}

    def _lasting(self, kind: str) -> None:
        """Switch a lasting fault on; `none` switches all of them off and disarms the others."""
        none = kind == "none"
        if none:
            self._faults.clear()
        self._bench.inverted = not none and (self._bench.inverted or kind == "polarity")
        self._instrument.date_lost = not none and (self._instrument.date_lost or kind == "dead-clock")
        self._instrument.bias_overload = not none and (self._instrument.bias_overload or kind == "bias-overload")
        self._instrument.no_list = not none and (self._instrument.no_list or kind == "no-list")

    def _trigger(self) -> None:
        if self._instrument.state["TRGS"] not in ("EXT", "MAN") or not self._instrument.sweeper.trigger():
            raise BenchError("bench: no sweep waits for an external or manual trigger; TRGS EXT and SING come first")


def _parsed(line: bytes) -> Any:
    """Return what a line says. Raises BenchError."""
    try:
        return json.loads(line, object_pairs_hook=once_each)
    except JsonFault as error:
        raise BenchError(f"bench: {error}") from None
    except (ValueError, RecursionError):  # ValueError: no JSON, no UTF-8, or a number with thousands of digits
        raise BenchError("bench: the line is no JSON; one JSON object per line is needed") from None


def _text(command: Mapping[str, Any], key: str) -> str:
    value = command.get(key)
    if not isinstance(value, str):
        raise BenchError(f"bench: {key!r} is {value!r}; a text is needed")
    return value


def _switch(command: dict[str, Any], key: str) -> bool:
    value = command.pop(key)
    if not isinstance(value, bool):
        raise BenchError(f"bench: {key!r} is {value!r}; true or false is needed")
    return value


def _whole(command: Mapping[str, Any], key: str) -> int:
    value = command.get(key)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise BenchError(f"bench: {key!r} is {value!r}; a whole number is needed")
    return value


def _real(command: Mapping[str, Any], key: str) -> float:
    value = command.get(key)
    number = finite(value)
    if number is None:
        raise BenchError(f"bench: {key!r} is {quoted(value)}; a number is needed")
    return number


def _pause(command: Mapping[str, Any], key: str) -> float:
    seconds = _real(command, key)
    if not 0 <= seconds <= LONGEST_PAUSE:  # whoever else uses the bench waits for its end
        raise BenchError(f"bench: {key!r} is {seconds:g}; 0 to {LONGEST_PAUSE:g} is allowed")
    return seconds


def _options(command: Mapping[str, Any]) -> dict[str, float | str]:
    unknown = sorted(set(command) - {"kind", "at", "seconds", "message", "bytes"})
    if unknown:
        raise BenchError(f"fault: no option {unknown[0]!r}; there are at, seconds, message, bytes")
    options: dict[str, float | str] = {k: _real(command, k) for k in ("seconds", "bytes") if k in command}
    return options | ({"message": _text(command, "message")} if "message" in command else {})
