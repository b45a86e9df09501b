"""Waveform analysis over its own range: extremes, peaks, crossings, ripples, resonators (PM p.106-109)."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from ...models.base.arrays import Reals
from ..instrument.axis import limits
from ..instrument.instrument import Instrument
from ..instrument.search_range import Indices, analysed
from ..instrument.settings import Number, number, whole
from ..instrument.trace_data import data_trace, memory_trace
from ..instrument.trace_search import analysis_peaks, crossings, ripples
from .command_entry import Ask, Entry
from .formats import encode, printed
from .messages import CommandError, Unit

NONE = float(np.finfo(np.float32).max)
"""Reply to LMAXS? and LMINS? where there is no such peak (PM p.343)."""
HIGHEST = 9.9e37


def _trace(instrument: Instrument) -> tuple[Reals, Reals]:
    """Return positions and values to analyse, from data or memory; of a complex trace the magnitude."""
    within = analysed(instrument)
    memory = instrument.state.radios["ANAOMEMO"]
    first, second = memory_trace(instrument) if memory else data_trace(instrument)
    shown = np.hypot(first, second) if instrument.state["MEAS"] == "COMP" else first
    return instrument.sweeper.axis.values[within], shown[within]


def _logarithmic(instrument: Instrument) -> bool:
    return instrument.formats[str(instrument.state["TRAC"])] == "LOGY"


def _peaks(instrument: Instrument, negative: bool) -> Indices:
    _, y = _trace(instrument)
    return analysis_peaks(y, instrument.threshold, _logarithmic(instrument), negative)


def _answer(instrument: Instrument, *numbers: float) -> bytes:
    return encode(np.array(numbers), instrument.state.form)


def _extreme(*kinds: str) -> Ask:
    def ask(instrument: Instrument, _: Unit) -> bytes:
        x, y = _trace(instrument)
        found = [int(np.argmin(y) if kind == "min" else np.argmax(y)) for kind in kinds]
        return _answer(instrument, *(float(v) for k in found for v in (y[k], x[k])))

    return ask


def _first_peak(negative: bool) -> Ask:
    """PEAK?, NPEAK?: the highest (deepest) peak, the leftmost of equals; NEXPK? and NEXNPK? return the others."""

    def ask(instrument: Instrument, _: Unit) -> bytes:
        y = _trace(instrument)[1]
        peaks = _peaks(instrument, negative)
        order = peaks[np.argsort(y[peaks] if negative else -y[peaks], kind="stable")]
        kind = "NEXNPK" if negative else "NEXPK"
        instrument.peaks_left[kind] = order.tolist()
        return _take_peak(instrument, kind)

    return ask


def _next_peak(kind: str) -> Ask:
    return lambda instrument, _: _take_peak(instrument, kind)


def _take_peak(instrument: Instrument, kind: str) -> bytes:
    x, y = _trace(instrument)
    left = instrument.peaks_left.get(kind, [])
    if not left or left[0] >= y.size:  # none left, or the range has changed since
        return _answer(instrument, 0.0, 0.0)
    k = left.pop(0)
    return _answer(instrument, float(y[k]), float(x[k]))


def _numbered(negative: bool) -> Ask:
    """LMAXS? n, LMINS? n: the n-th peak from the left."""

    def ask(instrument: Instrument, unit: Unit) -> bytes:
        x, y = _trace(instrument)
        peaks, n = _peaks(instrument, negative), round(number(unit.arguments[0]))
        if not 1 <= n <= peaks.size:
            return _answer(instrument, NONE, 0.0)
        return _answer(instrument, float(y[peaks[n - 1]]), float(x[peaks[n - 1]]))

    return ask


def _crossing(from_right: bool) -> Ask:
    def ask(instrument: Instrument, unit: Unit) -> bytes:
        target = number(unit.arguments[0])
        if abs(target) > HIGHEST:
            raise CommandError(-222)
        found = crossings(*_trace(instrument), target)
        return _answer(instrument, float(found[-1 if from_right else 0]) if found.size else 0.0)

    return ask


def _ripple(instrument: Instrument) -> tuple[float, float]:
    _, y = _trace(instrument)
    return ripples(y, _peaks(instrument, False), _peaks(instrument, True))


def _peak_to_peak(positions: bool) -> Ask:
    def ask(instrument: Instrument, _: Unit) -> bytes:
        x, y = _trace(instrument)
        peaks, dips = _peaks(instrument, False), _peaks(instrument, True)
        if not (peaks.size and dips.size):
            return _answer(instrument, *([0.0] * (3 if positions else 1)))
        top, bottom = int(peaks[np.argmax(y[peaks])]), int(dips[np.argmin(y[dips])])
        found = (float(y[top] - y[bottom]), float(x[top]), float(x[bottom]))
        return _answer(instrument, *(found if positions else found[:1]))

    return ask


# resonators: only for frequency sweeps of |Z| and phase ---------------------------------------------------------------


def _is_resonator(instrument: Instrument) -> bool:
    """Return whether the sweep can be analysed as a resonator; if not, queue the error and answer zeros."""
    state = instrument.state
    wrong = 131 if state["SWPP"] != "FREQ" else 105 if state["MEAS"] != "IMPH" else 0
    if wrong:
        instrument.status.error(CommandError(wrong))
    return not wrong


def _of_resonator(instrument: Instrument) -> tuple[Reals, Reals, Reals]:
    within = analysed(instrument)
    x = instrument.sweeper.axis.values[within]
    size, phase = (data_trace(instrument, trace)[0][within] for trace in "AB")
    return x, size, phase


def _zero_phase(instrument: Instrument) -> tuple[float, float, float, float]:
    x, size, phase = _of_resonator(instrument)
    places: list[float] = crossings(x, phase, 0.0)[:2].tolist()
    found = [v for place in places for v in (float(np.interp(place, x, size)), place)]
    Zr, fr, Za, fa = (*found, *([0.0] * (4 - len(found))))
    return Zr, fr, Za, fa


def _resonance(instrument: Instrument, _: Unit) -> bytes:
    return _answer(instrument, *(_zero_phase(instrument) if _is_resonator(instrument) else [0.0] * 4))


def _with_ripples(instrument: Instrument, found: tuple[float, float, float, float]) -> bytes:
    """Also answer the ripples left of the resonance, between both, and right of the antiresonance."""
    x, size, _ = _of_resonator(instrument)
    edges = [float(x[0]), found[1] or float(x[-1]), found[3] or float(x[-1]), float(x[-1])]
    parts = [size[(x > a) & (x < b)] for a, b in pairwise(edges)]
    heights = [max(ripples(y, *(analysis_peaks(y, 0.0, False, negative) for negative in (False, True)))) for y in parts]
    return _answer(instrument, *found, *heights)


def _resonance_and_ripples(instrument: Instrument, _: Unit) -> bytes:
    if not _is_resonator(instrument):
        return _answer(instrument, *[0.0] * 7)
    return _with_ripples(instrument, _zero_phase(instrument))


def _ceramic(instrument: Instrument, _: Unit) -> bytes:
    """OUTPCERR?: resonance is the lowest negative peak of |Z|, antiresonance its highest peak."""
    if not _is_resonator(instrument):
        return _answer(instrument, *[0.0] * 7)
    x, size, _phase = _of_resonator(instrument)
    ratio = instrument.formats["A"] == "LOGY"
    dips = analysis_peaks(size, instrument.threshold, ratio, True)
    peaks = analysis_peaks(size, instrument.threshold, ratio, False)
    low = int(dips[np.argmin(size[dips])]) if dips.size else None
    high = int(peaks[np.argmax(size[peaks])]) if peaks.size else None
    at = [(0.0, 0.0) if k is None else (float(size[k]), float(x[k])) for k in (low, high)]
    return _with_ripples(instrument, (*at[0], *at[1]))


def _admittance(instrument: Instrument) -> tuple[Reals, Reals, Reals]:
    x, size, phase = _of_resonator(instrument)
    y = np.exp(-1j * np.deg2rad(phase)) / np.where(size == 0, 1.0, size)
    return x, y.real, y.imag


def _four_elements(instrument: Instrument, _: Unit) -> bytes:
    """EQUCPARS4?: C0, C1, L1, R1, fs, fa, fr, f1, f2 of the admittance circle (PM p.312-313)."""
    if not _is_resonator(instrument):
        return _answer(instrument, *[0.0] * 9)
    f, G, B = _admittance(instrument)
    top = int(np.argmax(G))
    if not 0 < top < f.size - 1:
        return _answer(instrument, *[0.0] * 9)
    fs, R1 = float(f[top]), 1 / float(G[top])
    half = crossings(f, G, float(G[top]) / 2)
    below, above = half[half < fs], half[half > fs]
    if not (below.size and above.size):
        return _answer(instrument, *[0.0] * 9)
    f1, f2 = float(below[-1]), float(above[0])
    quality = fs / (f2 - f1)
    L1, C1 = quality * R1 / (2 * np.pi * fs), 1 / (quality * R1 * 2 * np.pi * fs)
    fr, fa = _zero_phase(instrument)[1::2]
    C0 = C1 * fr**2 / (fa**2 - fr**2) if fa > fr else float(B[top]) / (2 * np.pi * fs)
    return _answer(instrument, C0, C1, L1, R1, fs, fa, fr, f1, f2)


def _parallel_capacitance(instrument: Instrument, unit: Unit) -> bytes:
    """EQUC0? f: the capacitance of B at a frequency, 0 outside the range."""
    at = number(unit.arguments[0], "HZ")
    if not _is_resonator(instrument):
        return _answer(instrument, 0.0)
    f, _, B = _admittance(instrument)
    inside = float(f[0]) <= at <= float(f[-1])
    return _answer(instrument, float(np.interp(at, f, B)) / (2 * np.pi * at) if inside else 0.0)


# the range and the threshold -----------------------------------------------------------------------------------------


def _set_range(instrument: Instrument, unit: Unit) -> None:
    kind = limits("STAR", instrument.state.swept, "LIN")
    x = instrument.sweeper.axis.values
    low, high = sorted(min(max(number(a, kind.unit), float(x.min())), float(x.max())) for a in unit.arguments)
    inside = x[(x >= low) & (x <= high)]
    if inside.size:
        instrument.borders["A"].analysis = (float(inside.min()), float(inside.max()))
        instrument.borders["A"].analysis_segment = None


def _full_range(instrument: Instrument, _: Unit) -> None:
    instrument.borders["A"].analysis = instrument.borders["A"].analysis_segment = None


def _range(instrument: Instrument, _: Unit) -> str:
    x = instrument.sweeper.axis.values
    return ",".join(map(printed, instrument.borders["A"].analysis or (float(x.min()), float(x.max()))))


def _choose_segment(instrument: Instrument, unit: Unit) -> None:
    if instrument.state["SWPT"] != "LIST":
        raise CommandError(132)
    most = len(instrument.state.table.segments)
    instrument.borders["A"].analysis_segment = whole(unit.arguments[0], 1, most)


def _segment(instrument: Instrument, _: Unit) -> str:
    return str(instrument.borders["A"].analysis_segment or 1) if instrument.state["SWPT"] == "LIST" else "0"


def _set_threshold(instrument: Instrument, unit: Unit) -> None:
    value = number(unit.arguments[0])
    if value > HIGHEST:
        raise CommandError(-222)
    instrument.threshold = Number(1.0 if _logarithmic(instrument) else 0.0, HIGHEST, 0.0).rounded(value)


ANALYSIS_COMMANDS: Mapping[str, Entry] = {
    "ANARANG": Entry(_set_range, 2, 2),
    "ANARFULL": Entry(_full_range),
    "ANASEGM": Entry(_choose_segment, 1, 1),
    "THRR": Entry(_set_threshold, 1, 1),
}
"""Commands by mnemonic."""

ANALYSIS_QUERIES: Mapping[str, Entry] = {
    "ANARANG": Entry(_range),
    "ANASEGM": Entry(_segment),
    "THRR": Entry(lambda i, _: printed(max(i.threshold, 1.0) if _logarithmic(i) else i.threshold)),
    "OUTPMAX": Entry(_extreme("max")),
    "OUTPMIN": Entry(_extreme("min")),
    "OUTPMINMAX": Entry(_extreme("min", "max")),
    "PEAK": Entry(_first_peak(False)),
    "NPEAK": Entry(_first_peak(True)),
    "NEXPK": Entry(_next_peak("NEXPK")),
    "NEXNPK": Entry(_next_peak("NEXNPK")),
    "LMAXS": Entry(_numbered(False), 1, 1),
    "LMINS": Entry(_numbered(True), 1, 1),
    "TARL": Entry(_crossing(True), 1, 1),
    "TARR": Entry(_crossing(False), 1, 1),
    "RPLHEI": Entry(lambda i, _: _answer(i, max(_ripple(i)))),
    "RPLLHEI": Entry(lambda i, _: _answer(i, _ripple(i)[0])),
    "RPLRHEI": Entry(lambda i, _: _answer(i, _ripple(i)[1])),
    "RPLPP": Entry(_peak_to_peak(False)),
    "RPLPPS": Entry(_peak_to_peak(True)),
    "OUTPRESO": Entry(_resonance),
    "OUTPRESR": Entry(_resonance_and_ripples),
    "OUTPCERR": Entry(_ceramic),
    "EQUCPARS4": Entry(_four_elements),
    "EQUC0": Entry(_parallel_capacitance, 1, 1),
}
"""Queries by mnemonic, without the question mark."""
