"""Touchstone 1 for one port: `.s1p`, `.z1p`, `.y1p`.

pzctl has its own reader and writer of some hundred lines, because scikit-rf requires pandas and does not report the
line of an error. In the tests, scikit-rf reads the files written here, and both read the same files alike.

Z and Y of Touchstone 1 are normalised to the R of the option line, which some programs ignore. So pzctl writes S, which
all programs read alike. It multiplies Z or Y that it reads by R, and says so in a note.
"""

from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Impedances, Reals
from ....models.sweep import Sweep
from ..assemble import REFERENCE, Points, assemble
from ..provenance import FORMAT, Provenance, check_points, provenance_lines, read_provenance
from ..text_file import RecordingError, TextFile, clipped

_UNITS = {"HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "GHZ": 1e9}
SUFFIXES = (".s1p", ".z1p", ".y1p")


@dataclass(frozen=True)
class TouchstoneOptions:
    """The option line; missing entries have the standard's defaults."""

    unit: float = 1e9
    kind: str = "S"
    form: str = "MA"
    reference: float = 50.0
    """ohm."""


def read_touchstone(page: TextFile) -> tuple[Sweep, None]:
    """Return the recording in a Touchstone file of one port. Raises RecordingError."""
    options: TouchstoneOptions | None = None
    comments: list[tuple[int, str]] = []
    rows: list[tuple[int, list[float]]] = []
    for n, line in enumerate(page.lines, 1):
        text, mark, comment = line.partition("!")
        if mark and not text.strip():
            comments.append((n, comment))
        text = text.strip()
        if text.startswith("["):
            raise page.error(n, f"{clipped(text)!r} belongs to Touchstone 2; save as Touchstone 1")
        if text.startswith("#"):
            options = options or _options(page, text, n)
        elif text and options is None:
            raise page.error(n, "numbers before the option line; a line like `# Hz S RI R 50` comes first")
        elif text:
            rows.append((n, page.row(text.split(), ("frequency", "first number", "second number"), n, range(3))))
    if options is None:
        raise page.error(None, "no option line found; a line like `# Hz S RI R 50` says what the numbers are")
    provenance = _own_provenance(page, comments)
    check_points(page, provenance.rows, len(rows))
    numbers = np.array([row for _, row in rows], dtype=np.float64).reshape(len(rows), 3)
    points = Points([n for n, _ in rows], options.unit * numbers[:, 0], _impedance(options, numbers))
    notes = (*provenance.notes, *([] if options.kind == "S" else [_normalised(options)]))
    foreign = options.kind == "S" and not provenance.own
    reference = options.reference if foreign else None
    made = assemble(page, points, provenance.settings, provenance.time, provenance.id, notes, reference=reference)
    return made, None


def _normalised(options: TouchstoneOptions) -> str:
    return f"{options.kind} of Touchstone 1 is normalised to {options.reference:g} ohm; it was multiplied by that."


def _own_provenance(page: TextFile, comments: list[tuple[int, str]]) -> Provenance:
    """Return the provenance in pzctl's own comments; comments of other programs are ignored."""
    if any(text.strip() == f"format: {FORMAT}" for _, text in comments):
        return read_provenance(page, comments)
    return Provenance()


def _options(page: TextFile, text: str, line: int) -> TouchstoneOptions:
    words = text[1:].upper().split()
    options: dict[str, float | str] = {}
    while words:
        word = words.pop(0)
        if word in _UNITS:
            options["unit"] = _UNITS[word]
        elif word in ("S", "Y", "Z"):
            options["kind"] = word
        elif word in ("MA", "DB", "RI"):
            options["form"] = word
        elif word == "R" and words:
            options["reference"] = page.number(words.pop(0), "the reference R", line)
        else:
            raise page.error(
                line, f"{clipped(word)!r} in the option line is not known; a valid line is `# Hz S RI R 50`"
            )
    parsed = TouchstoneOptions(**options)  # type: ignore[arg-type]
    if parsed.reference <= 0:
        raise page.error(line, f"the reference R is {parsed.reference:g} ohm; a positive one is needed")
    return parsed


def _impedance(options: TouchstoneOptions, numbers: Reals) -> Impedances:
    """Return Z in ohm, shape (N,), from frequency and number pairs, shape (N, 3); not finite where S = 1."""
    a, b = numbers[:, 1], numbers[:, 2]
    with np.errstate(all="ignore"):
        if options.form == "RI":
            value = np.asarray(a + 1j * b, dtype=np.complex128)
        else:
            size = a if options.form == "MA" else 10 ** (a / 20)
            value = np.asarray(size * np.exp(1j * np.radians(b)), dtype=np.complex128)
        if options.kind == "S":
            return options.reference * (1 + value) / (1 - value)
        return options.reference * value if options.kind == "Z" else options.reference / value


def touchstone_text(sweep: Sweep) -> str:
    """Return the recording as Touchstone 1, reflection at 50 ohm. Raises RecordingError if Z is -50 ohm."""
    z = sweep.impedance
    if np.any(z == -REFERENCE):
        raise RecordingError("an impedance of -50 ohm has no reflection at 50 ohm; write CSV instead")
    s = (z - REFERENCE) / (z + REFERENCE)
    lines = [f"! {line}" for line in provenance_lines(sweep, z.size)]
    lines.append(f"# Hz S RI R {REFERENCE:g}")
    lines += [f"{f!r} {v.real!r} {v.imag!r}" for f, v in zip(sweep.frequency.tolist(), s.tolist(), strict=True)]
    return "\n".join(lines) + "\n"
