"""Calibration and compensation: measuring the standards, switching them, their arrays (PM p.54-70, 83)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Impedances
from ..instrument.axis import Axis
from ..instrument.correction import FIXED_POINTS, STANDARDS, Correction, as_kept
from ..instrument.instrument import Instrument
from ..instrument.settings import Switch
from .command_entry import Act, Ask, Entry
from .data_commands import ARRAY_PARAMETERS, as_complex, as_pairs
from .formats import decode, encode
from .messages import CommandError, Unit

CALIBRATED_ADAPTERS = ("APC7", "PROBE")
"""Adapters for which the instrument has a user calibration (PM p.274)."""

ADAPTER_STEPS: Mapping[str, frozenset[str]] = {
    **dict.fromkeys(("M1", "M2"), frozenset("PC")),
    **dict.fromkeys(CALIBRATED_ADAPTERS, frozenset("PABC")),
}
"""Steps of an adapter's set-up, by the last letter of the mnemonic (PM p.309)."""

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


def _measure(standard: str) -> Act:
    """COMA, COMB, COMC: measure, compute and switch on."""

    def act(instrument: Instrument, _: Unit) -> None:
        axis = _standard_axis(instrument)

        def done(_: Axis, z: Impedances) -> None:
            z = instrument.calibration.apply(axis.frequency, z, instrument.state)
            instrument.compensation.store(standard, axis.frequency, z)

        instrument.sweeper.start(1, done, axis)

    return act


def _calibrate(standard: str) -> Act:
    """CALA, CALB, CALC: measure; CALDON computes."""

    def act(instrument: Instrument, _: Unit) -> None:
        if instrument.state["E4TP"] not in CALIBRATED_ADAPTERS:
            raise CommandError(12)
        axis = _standard_axis(instrument)

        def done(_: Axis, z: Impedances) -> None:
            instrument.calibrating[standard] = (axis.frequency, as_kept(standard, z))

        instrument.sweeper.start(1, done, axis)

    return act


def _finish_calibration(instrument: Instrument, _: Unit) -> None:
    if set(instrument.calibrating) != set(STANDARDS):
        raise CommandError(10)
    for standard, (frequency, values) in instrument.calibrating.items():
        instrument.calibration.put(standard, frequency, values)
    instrument.calibrating.clear()


def _quit_calibration(instrument: Instrument, _: Unit) -> None:
    """CALQUI: earlier coefficients stay."""
    if instrument.calibrating:
        instrument.calibrating.clear()
        raise CommandError(13)


def _set_up_adapter(step: str) -> Act:
    """ECALP, ECALA ...: measure for the adapter's set-up. The bench has no cable, so nothing needs correction."""

    def act(instrument: Instrument, _: Unit) -> None:
        if step not in _steps(instrument):
            raise CommandError(12)
        instrument.sweeper.start(1, lambda axis, z: instrument.adapter_steps.add(step), _standard_axis(instrument))

    return act


def _steps(instrument: Instrument) -> frozenset[str]:
    return ADAPTER_STEPS.get(str(instrument.state["E4TP"]), frozenset())


def _finish_adapter(instrument: Instrument, _: Unit) -> None:
    if not _steps(instrument):
        raise CommandError(12)
    if instrument.adapter_steps and not _steps(instrument) <= instrument.adapter_steps:
        raise CommandError(10)
    instrument.adapter_steps.clear()


def _quit_adapter(instrument: Instrument, _: Unit) -> None:
    if instrument.adapter_steps:
        instrument.adapter_steps.clear()
        raise CommandError(13)


def _switch(bank: Bank, standard: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        bank(instrument).switch(standard, Switch(False).parse(unit.arguments[0]))

    return act


def _switch_calibration(instrument: Instrument, unit: Unit) -> None:
    on = Switch(False).parse(unit.arguments[0])
    if on and set(instrument.calibration.measured) != set(STANDARDS):
        raise CommandError(11)
    for standard in sorted(instrument.calibration.measured):
        instrument.calibration.switch(standard, on)


def _written(instrument: Instrument, unit: Unit) -> tuple[Frequencies, Complexes]:
    frequency = _standard_axis(instrument).frequency
    return frequency, as_complex(decode(unit.arguments, instrument.state.form, 2 * frequency.size))


def _put(standard: str) -> Act:
    """INPUCOMC1 ...: take effect at once."""

    def act(instrument: Instrument, unit: Unit) -> None:
        instrument.compensation.put(standard, *_written(instrument, unit))

    return act


def _put_calibration(standard: str) -> Act:
    """INPUCALC1 ...: take effect when the third has arrived."""

    def act(instrument: Instrument, unit: Unit) -> None:
        instrument.calibrating[standard] = _written(instrument, unit)
        if set(instrument.calibrating) == set(STANDARDS):
            _finish_calibration(instrument, unit)

    return act


def _array(bank: Bank, standard: str) -> Ask:
    def ask(instrument: Instrument, _: Unit) -> bytes:
        measured = bank(instrument).measured.get(standard)
        if measured is None:
            raise CommandError(-230)
        return encode(as_pairs(measured), instrument.state.form)

    return ask


def _is_on(standard: str) -> Ask:
    return lambda instrument, _: "1" if standard in instrument.compensation.on else "0"


BLOCKING = frozenset(f"{kind}{s}" for kind in ("COM", "CAL", "ECAL") for s in (*STANDARDS, "P")) - {"CALP", "COMP"}
"""Commands that measure a standard. They are not overlapped: later commands wait until the measurement is done."""

CORRECTION_COMMANDS: Mapping[str, Entry] = {
    **{f"COM{s}": Entry(_measure(s)) for s in STANDARDS},
    **{f"CAL{s}": Entry(_calibrate(s)) for s in STANDARDS},
    **{f"COMST{s}": Entry(_switch(_compensation, s), 1, 1) for s in STANDARDS},
    "CALST": Entry(_switch_calibration, 1, 1),
    "CALDON": Entry(_finish_calibration),
    "CALQUI": Entry(_quit_calibration),
    **{f"ECAL{step}": Entry(_set_up_adapter(step)) for step in ("P", *STANDARDS)},
    "ECALDON": Entry(_finish_adapter),
    "ECALQUI": Entry(_quit_adapter),
    **{f"INPUCOMC{k}": Entry(_put(s), 1, ARRAY_PARAMETERS) for k, s in enumerate(STANDARDS, 1)},
    **{f"INPUCALC{k}": Entry(_put_calibration(s), 1, ARRAY_PARAMETERS) for k, s in enumerate(STANDARDS, 1)},
}
"""Commands by mnemonic."""

CORRECTION_QUERIES: Mapping[str, Entry] = {
    **{f"COMST{s}": Entry(_is_on(s)) for s in STANDARDS},
    "CALST": Entry(lambda i, _: "1" if i.calibration.on else "0"),
    **{f"OUTPCOMC{k}": Entry(_array(_compensation, s)) for k, s in enumerate(STANDARDS, 1)},
    **{f"OUTPCALC{k}": Entry(_array(_calibration, s)) for k, s in enumerate(STANDARDS, 1)},
}
"""Queries by mnemonic."""
