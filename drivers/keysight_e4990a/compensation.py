"""Fixture compensation of the E4990A: open, short and load are acquired, stored as arrays and written back later.

SENSe:CORRection2:COLLect:ACQuire:OPEN, SHORt and LOAD, each followed by `*OPC?`, are sent by three public programs
(rjollos/e4990a, a MATLAB class, a panel in Visual Basic); the array behind a standard (ZMEasurement:...:DATA) is read
by the first and written by the last. That LOAD has one as well, and that all are impedances in ohm as R, X in pairs, is
taken from the E5061B. If a written array does not read back, restoring is refused.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...models.base.arrays import Complexes
from ...models.sweep import now_utc
from ..base.analyzer import Identity, InstrumentError
from ..base.compensation import Compensation, Standard
from ..visa import replies
from ..visa.connection import Connection
from .capabilities import MOST_POINTS
from .settings import BIAS_ON, BLOCK_DIGITS, CORRECTIONS, SETTINGS, check_errors, put
from .sweeps import trigger

STANDARD_SECONDS = 110.0

LOAD_OHM = 50.0

_NAMES: Mapping[Standard, str] = {"open": "OPEN", "short": "SHOR", "load": "LOAD"}

_PROMPTS: Mapping[Standard, str] = {
    "open": "Leave the fixture open, contacts as far apart as with the sample.",
    "short": "Short-circuit the fixture with a clean, thick piece of metal.",
    "load": f"Connect the {LOAD_OHM:g} ohm load.",
}


def measure(
    link: Connection,
    identity: Identity,
    standards: Sequence[Standard],
    prompt: Callable[[str], None],
    tick: Callable[[float, str], None],
) -> Compensation:
    """Measure `standards`; see `Analyzer.compensate`. Raises InstrumentError, and what the callables raise."""
    unknown = [name for name in standards if name not in _NAMES]
    if unknown or not standards:
        raise InstrumentError(f"compensation: no standard {unknown or 'given'}; there are {', '.join(_NAMES)}")
    put(link, BIAS_ON, False)
    for name, value in {"continuous": True, "source": "BUS", "speed": 5, "mode": "VOLT", "level": 0.5}.items():
        put(link, SETTINGS[name], value)
    link.ask(":SENS1:CORR:COLL:FPO FIX;*ESR?")
    taken = now_utc()
    for name in standards:
        prompt(_PROMPTS[name])
        command = f":SENS1:CORR2:COLL:ACQ:{_NAMES[name]}"
        what = f"the {name} compensation"
        trigger(link, command, STANDARD_SECONDS, lambda passed, what=name: tick(passed, what), what, may_block=True)
        _check_plausible(link, name, _array(link, name))
        put(link, CORRECTIONS[name], True)
    return Compensation({name: _array(link, name) for name in standards}, "OFF", taken, identity.idn)


def apply(link: Connection, identity: Identity, stored: Compensation) -> None:
    """Write the arrays of `stored` back and switch them on; standards that it lacks are switched off.

    Raises InstrumentError for another instrument, or for arrays that do not read back as they were written.
    """
    if stored.instrument != identity.idn:
        raise InstrumentError(
            f"{link.name}: this compensation was measured by {stored.instrument}; the instrument here is {identity.idn}"
        )
    link.ask(":SENS1:CORR:COLL:FPO FIX;*ESR?")
    for name in _NAMES:
        values = stored.arrays.get(name)
        if values is not None:
            impedance = 1 / values if name == "open" else values
            pairs = np.column_stack([impedance.real, impedance.imag]).ravel()
            link.ask(f":SENS1:CORR2:ZME:{_NAMES[name]}:DATA {','.join(f'{v:.16e}' for v in pairs)};*ESR?")
            check_errors(link, f"after the stored {name} compensation")
            if not np.allclose(_array(link, name), values, rtol=1e-6, atol=0):
                raise InstrumentError(f"{link.name}: the stored {name} compensation does not read back as written")
        put(link, CORRECTIONS[name], values is not None)


def _array(link: Connection, name: Standard) -> Complexes:
    """Return a standard in the units of `Compensation`: open in siemens, others in ohm. Raises InstrumentError."""
    query = f":SENS1:CORR2:ZME:{_NAMES[name]}:DATA?"
    data = link.ask_block(f":FORM:DATA REAL;:FORM:BORD NORM;{query}", 16 * MOST_POINTS, BLOCK_DIGITS)
    pairs = replies.doubles(data, len(data) // 16 * 2, f"{link.name}: {query}")
    link.ask(":FORM:DATA ASC;*ESR?")
    if not pairs.size:
        raise InstrumentError(f"{link.name}: {query}: no {name} compensation is stored")
    impedance = pairs[0::2] + 1j * pairs[1::2]
    return 1 / impedance if name == "open" else impedance


def _check_plausible(link: Connection, name: Standard, values: Complexes) -> None:
    """Switch compensation off and raise InstrumentError where a wrong standard was connected.

    The test uses the lowest frequency, where a fixture's own capacitance or inductance does not matter.
    """
    size = abs(values[0])
    limit, unit = {"open": (1e-3, "S"), "short": (10.0, "ohm"), "load": (2 * LOAD_OHM, "ohm")}[name]
    if size > limit or (name == "load" and size < LOAD_OHM / 2):
        put(link, CORRECTIONS[name], False)
        raise InstrumentError(
            f"{link.name}: {name} compensation: {size:.3g} {unit} was measured; at most {limit:g} {unit} can be; "
            f"{_PROMPTS[name]}"
        )
