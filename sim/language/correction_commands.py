"""Calibration and compensation: measuring the standards, switching them, their arrays (reference 2.8; PM p.63, 83)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ...models.base.arrays import Impedances
from ..instrument.axis import Axis
from ..instrument.correction import FIXED_POINTS, STANDARDS, Correction
from ..instrument.instrument import Instrument
from ..instrument.settings import Switch
from .command_entry import Act, Ask, Entry
from .data_commands import ARRAY_PARAMETERS, as_complex, as_pairs
from .formats import decode, encode
from .messages import CommandError, Unit

Bank: TypeAlias = Callable[[Instrument], Correction]


def _calibration(instrument: Instrument) -> Correction:
    return instrument.calibration


def _compensation(instrument: Instrument) -> Correction:
    return instrument.compensation


def _standard_axis(instrument: Instrument) -> Axis:
    """Return the axis for measuring a standard: the points of the sweep (CALP USER) or the fixed ones."""
    axis = instrument.state.axis()
    if instrument.state["CALP"] == "USER" and np.all(np.diff(axis.frequency) > 0):
        return axis
    same = np.ones(FIXED_POINTS.size)
    first = {name: same * getattr(axis, name)[0] for name in ("level", "bandwidth", "point_average")}
    return replace(axis, values=FIXED_POINTS, frequency=FIXED_POINTS, **first)


def _measure(bank: Bank, standard: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        axis = _standard_axis(instrument)

        def done(_: Axis, z: Impedances) -> None:
            if bank is _compensation:
                z = instrument.calibration.apply(axis.frequency, z, instrument.state)
            bank(instrument).store(standard, axis.frequency, z)

        instrument.sweeper.start(1, done, axis)

    return act


def _set_up_adapter(instrument: Instrument, _: Unit) -> None:
    """ECALP, ECALA ...: measure for the adapter's set-up. The bench has no cable, so nothing needs correction."""
    _need_adapter(instrument, _)
    instrument.sweeper.start(1, lambda axis, z: None, _standard_axis(instrument))


def _need_adapter(instrument: Instrument, _: Unit) -> None:
    if instrument.state["E4TP"] == "OFF":
        raise CommandError(-221, "SETTINGS CONFLICT; NO ADAPTER IS SELECTED")


def _switch(bank: Bank, standard: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        bank(instrument).switch(standard, Switch(False).parse(unit.arguments[0]))

    return act


def _switch_calibration(instrument: Instrument, unit: Unit) -> None:
    on = Switch(False).parse(unit.arguments[0])
    measured = sorted(instrument.calibration.measured)
    if on and not measured:
        raise CommandError(-221, "SETTINGS CONFLICT; NO COEFFICIENTS")
    for standard in measured:
        instrument.calibration.switch(standard, on)


def _put(bank: Bank, standard: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        frequency = _standard_axis(instrument).frequency
        values = as_complex(decode(unit.arguments, instrument.state.form, 2 * frequency.size))
        bank(instrument).put(standard, frequency, values)

    return act


def _array(bank: Bank, standard: str) -> Ask:
    def ask(instrument: Instrument, _: Unit) -> bytes:
        measured = bank(instrument).measured.get(standard)
        if measured is None:
            raise CommandError(-230, "DATA CORRUPT OR STALE")
        return encode(as_pairs(measured), instrument.state.form)

    return ask


def _is_on(standard: str) -> Ask:
    return lambda instrument, _: "1" if standard in instrument.compensation.on else "0"


CORRECTION_COMMANDS: Mapping[str, Entry] = {
    **{f"COM{s}": Entry(_measure(_compensation, s)) for s in STANDARDS},
    **{f"CAL{s}": Entry(_measure(_calibration, s)) for s in STANDARDS},
    **{f"COMST{s}": Entry(_switch(_compensation, s), 1, 1) for s in STANDARDS},
    "CALST": Entry(_switch_calibration, 1, 1),
    **{f"ECAL{step}": Entry(_set_up_adapter) for step in ("P", *STANDARDS)},
    "ECALDON": Entry(_need_adapter),
    **{f"INPUCOMC{k}": Entry(_put(_compensation, s), 1, ARRAY_PARAMETERS) for k, s in enumerate(STANDARDS, 1)},
    **{f"INPUCALC{k}": Entry(_put(_calibration, s), 1, ARRAY_PARAMETERS) for k, s in enumerate(STANDARDS, 1)},
}
"""Commands by mnemonic."""

CORRECTION_QUERIES: Mapping[str, Entry] = {
    **{f"COMST{s}": Entry(_is_on(s)) for s in STANDARDS},
    "CALST": Entry(lambda i, _: "1" if i.calibration.on else "0"),
    **{f"OUTPCOMC{k}": Entry(_array(_compensation, s)) for k, s in enumerate(STANDARDS, 1)},
    **{f"OUTPCALC{k}": Entry(_array(_calibration, s)) for k, s in enumerate(STANDARDS, 1)},
}
"""Queries by mnemonic."""
