"""Fixture compensation: open, short and load are measured in turn, stored as arrays and written back later.

At 3 MHz the 200 nH of a pair of clips are 3.8 ohm, as much as a disk at its thickness resonance: without short
compensation the jig dominates the measurement. Programming Manual p.63, p.83. The driver uses `CALP FIXED`: the
instrument measures at its own points from 40 Hz to 110 MHz and interpolates; one compensation serves every sweep.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes
from ....models.sweep import now_utc
from ...base.analyzer import Identity, InstrumentError
from ...base.compensation import Compensation, Standard
from ...visa import replies
from ...visa.connection import Connection
from ..protocol import error_queue as errorqueue
from ..protocol import settings
from ..protocol import sweep_wait as wait

STANDARD_SECONDS = 110.0
"""Expected time of a standard: users report tens of seconds to minutes; other programs wait for 120 to 180 s."""

MOST_BYTES = 2 * 8 * 801
"""Longest array: the complex doubles of one sweep."""

LOAD_OHM = 50.0


@dataclass(frozen=True)
class _Recipe:
    command: str
    switch: str
    output: str
    input: str
    prompt: str


_RECIPES: Mapping[Standard, _Recipe] = {
    "open": _Recipe(
        "COMA", "COMSTA", "OUTPCOMC1?", "INPUCOMC1", "Leave the fixture open, contacts as far apart as with the sample."
    ),
    "short": _Recipe(
        "COMB", "COMSTB", "OUTPCOMC2?", "INPUCOMC2", "Short-circuit the fixture with a clean, thick piece of metal."
    ),
    "load": _Recipe("COMC", "COMSTC", "OUTPCOMC3?", "INPUCOMC3", f"Connect the {LOAD_OHM:g} ohm load."),
}


def measure(
    link: Connection,
    identity: Identity,
    standards: Sequence[Standard],
    adapter: str,
    prompt: Callable[[str], None],
    tick: Callable[[float, str], None],
) -> Compensation:
    """Measure `standards`; see `Agilent4294A.compensate`. Raises InstrumentError, and what the callables raise."""
    unknown = [name for name in standards if name not in _RECIPES]
    if unknown or not standards:
        raise InstrumentError(f"compensation: no standard {unknown or 'given'}; there are {', '.join(_RECIPES)}")
    for mnemonic, value in {
        "DCO": False,
        "E4TP": adapter,
        "CALP": "FIXED",
        "BWFACT": 5,
        "POWMOD": "VOLT",
        "POWE": 0.5,
    }.items():
        settings.put(link, mnemonic, value)
    taken = now_utc()
    for name in standards:
        recipe = _RECIPES[name]
        prompt(recipe.prompt)
        what = f"the {name} compensation"
        wait.measure_standard(
            link, recipe.command, STANDARD_SECONDS, lambda passed, what=name: tick(passed, what), what
        )
        _check_plausible(link, name, _array(link, name))
        settings.put(link, recipe.switch, True)
    return Compensation({name: _array(link, name) for name in standards}, adapter, taken, identity.idn)


def apply(link: Connection, identity: Identity, stored: Compensation) -> None:
    """Write the arrays of `stored` back and switch them on; standards that it lacks are switched off.

    Raises InstrumentError for another instrument, or for arrays that do not read back as they were written.
    """
    if stored.instrument != identity.idn:
        raise InstrumentError(
            f"{link.name}: this compensation was measured by {stored.instrument}; the instrument here is {identity.idn}"
        )
    settings.put(link, "E4TP", stored.adapter)
    settings.put(link, "CALP", "FIXED")
    for name, recipe in _RECIPES.items():
        values = stored.arrays.get(name)
        if values is not None:
            pairs = np.column_stack([values.real, values.imag]).ravel()
            link.ask(f"FORM4;{recipe.input} {','.join(f'{value:.16e}' for value in pairs)};*STB?")
            errorqueue.check(link, f"after the stored {name} compensation ({recipe.input})")
            if not np.allclose(_array(link, name), values, rtol=1e-6, atol=0):
                raise InstrumentError(f"{link.name}: the stored {name} compensation does not read back as written")
        settings.put(link, recipe.switch, values is not None)


def _array(link: Connection, name: Standard) -> Complexes:
    query = _RECIPES[name].output
    data = link.ask_block(f"FORM3;{query}", MOST_BYTES, settings.LENGTH_DIGITS)
    pairs = replies.doubles(data, len(data) // 16 * 2, f"{link.name}: {query}")
    if not pairs.size:
        raise InstrumentError(f"{link.name}: {query}: no {name} compensation is stored")
    return pairs[0::2] + 1j * pairs[1::2]


def _check_plausible(link: Connection, name: Standard, values: Complexes) -> None:
    """Switch compensation off and raise InstrumentError where a wrong standard was connected.

    The test uses the lowest frequency, where a fixture's own capacitance (100 pF) or inductance (1 uH) does not matter.
    """
    size = abs(values[0])
    limit, unit = {"open": (1e-3, "S"), "short": (10.0, "ohm"), "load": (2 * LOAD_OHM, "ohm")}[name]
    if size > limit or (name == "load" and size < LOAD_OHM / 2):
        settings.put(link, _RECIPES[name].switch, False)
        raise InstrumentError(
            f"{link.name}: {name} compensation: {size:.3g} {unit} was measured; at most {limit:g} {unit} can be; "
            f"{_RECIPES[name].prompt}"
        )
