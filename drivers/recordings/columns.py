"""Column names as people and instruments write them: quantity, unit, data or memory trace."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Reals
from .assemble import Points
from .convert import RESISTANCE_WEAK, SIGN_LOST, loss_is_signed, to_impedance
from .text_file import TextFile, clipped, has_decimal_comma, is_number

_NAMES = {
    "f": "f freq frequency frequenz messfrequenz frequence",
    "R": "r rs re(z) real(z) rez zreal zre z' resistance wirkwiderstand serienwiderstand "
    "realteil realteil(z) realteilz partiereelle partiereelle(z) partiereelledez",
    "X": "x xs im(z) imag(z) imz zimag zim z'' reactance blindwiderstand "
    "imaginarteil imaginarteil(z) imaginarteilz imaginaerteil imaginaerteil(z) partieimaginaire partieimaginaire(z) "
    "partieimaginairedez",
    "G": "g gp re(y) real(y) conductance wirkleitwert realteil(y) partiereelle(y)",
    "B": "b bp im(y) imag(y) susceptance blindleitwert imaginarteil(y) imaginaerteil(y) partieimaginaire(y)",
    "|Z|": "|z| z abs(z) mag(z) zmod zabs zmag impedance impedanz scheinwiderstand betrag(z) module(z) "
    "impedance:magnitude magnitude(z) impedanz:betrag",
    "theta": "theta th theta-z θ θz theta(z) phase phase(z) arg(z) phase-z phaseangle phasenwinkel dephasage "
    "impedance:phase impedanz:phase",
    "|Y|": "|y| y abs(y) mag(y) yabs ymag admittance admittanz scheinleitwert betrag(y) module(y)",
    "theta-y": "theta-y θy theta(y) phase(y) arg(y) phase-y",
    "Cp": "cp parallelkapazitat capaciteparallele",
    "Cs": "cs serienkapazitat capaciteserie",
    "Lp": "lp parallelinduktivitat inductanceparallele",
    "Ls": "ls serieninduktivitat inductanceserie",
    "Rp": "rp parallelwiderstand resistanceparallele",
    "D": "d dissipationfactor verlustfaktor facteurdepertes",
    "Q": "q qualityfactor gute gutefaktor guete facteurdequalite",
}
"""Names in English, German and French, in small letters without blanks and accents."""
QUANTITIES = {name: quantity for quantity, names in _NAMES.items() for name in names.split()}
REFLECTION = re.compile(r"return\s*loss|swr|vswr|s11", re.IGNORECASE)
"""With such a column in the table, `phase` is the angle of the reflection, not of the impedance."""

NO_HEADER = ", or name the columns with --columns frequency_Hz,R_ohm,X_ohm"
"""What helps where the first row has numbers."""

_OHM, _SIEMENS = ("ohm", "ohms", "Ω", "Ω"), ("s", "siemens", "mho")
_ANGLE = ("deg", "degree", "degrees", "°", "grad", "degre", "degres", "rad")  # Grad: German for degree
_BASES = {
    "f": ("hz",),
    **dict.fromkeys(("theta", "theta-y"), _ANGLE),
    **dict.fromkeys(("D", "Q"), ("",)),
    **dict.fromkeys(("R", "X", "|Z|", "Rp"), _OHM),
    **dict.fromkeys(("G", "B", "|Y|"), _SIEMENS),
    **dict.fromkeys(("Cp", "Cs"), ("f",)),
    **dict.fromkeys(("Lp", "Ls"), ("h",)),
}
_PREFIXES = {"": 1.0, "k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "n": 1e-9}
_PREFIXES["p"] = 1e-12
_DECIBELS = {f"db{unit}" for unit in ("ohm", "\u03c9", "s", "siemens")}
"""Of |Z| or |Y|, relative to one ohm or one siemens."""
_TRACE = re.compile(r"trace ?\d* ?:? ?(?=\S)", re.IGNORECASE)
"""What network analyzers write before the name of a quantity."""
_NO_UNIT_SAID = {*_OHM, *_SIEMENS}
_EXAMPLE = {"f": "frequency_Hz", "theta": "theta_deg", "theta-y": "theta-y_deg"}
_WITH_UNIT = re.compile(r"(.+?) ?(?:[(\[] ?([^()\[\]]*?) ?[)\]]|/ ?(\S+)|_([^\W_]+|°))")
"""For names with single blanks only: with `\\s*` the time would grow with the square of their number."""

PAIRS = (
    ("R", "X", "IRIM"), ("G", "B", "ARIM"), ("|Z|", "theta", "IMPH"), ("|Y|", "theta-y", "AMPH"),
    ("|Y|", "theta", "AMPH"), ("Ls", "R", "LSR"), ("Ls", "Q", "LSQ"), ("Cs", "R", "CSR"), ("Cs", "Q", "CSQ"),
    ("Cs", "D", "CSD"), ("Lp", "G", "LPG"), ("Lp", "Q", "LPQ"), ("Lp", "Rp", "LPR"), ("Cp", "G", "CPG"),
    ("Cp", "Q", "CPQ"), ("Cp", "D", "CPD"), ("Cp", "Rp", "CPR"), ("|Z|", "Ls", "IMLS"), ("|Z|", "Cs", "IMCS"),
    ("|Z|", "Lp", "IMLP"), ("|Z|", "Cp", "IMCP"), ("|Z|", "R", "IMRS"), ("|Z|", "Q", "IMQ"), ("|Z|", "D", "IMD"),
)  # fmt: skip
"""Pairs of quantities that determine an impedance, the best first, with the name of the measurement parameter."""


@dataclass(frozen=True)
class ColumnMeaning:
    """The meaning of a recognised column."""

    index: int
    quantity: str
    name: str
    factor: float | None
    """SI value (radians for an angle) = number times this; None if the unit is not known."""
    memory: bool
    unit: str | None
    """None if the name has none."""

    @property
    def in_decibels(self) -> bool:
        """Whether its numbers are 20 lg of the quantity in SI units."""
        return self.quantity in ("|Z|", "|Y|") and _plain(self.unit or "") in _DECIBELS


def read_header(page: TextFile, cells: Sequence[str], line: int) -> list[ColumnMeaning]:
    """Return the recognised columns of a header row, ignoring others.

    Raises RecordingError if there is no frequency.
    """
    beside_reflection = of_reflection(cells)
    columns: list[ColumnMeaning] = []
    for k, cell in enumerate(cells):
        column = _column(k, cell)
        if column and not (beside_reflection and cell.strip(' "').casefold().startswith("phase")):
            columns.append(column)
    if not any(column.quantity == "f" for column in columns):
        found = ", ".join(clipped(cell.strip(' "')) for cell in cells[:6])
        says = f"no frequency column among {found}; name it in the header row, for example frequency_Hz"
        raise page.error(line, says + (NO_HEADER if all(map(is_number, cells)) else ""))
    return columns


def _column(index: int, cell: str) -> ColumnMeaning | None:
    name = " ".join(cell.strip().strip("\"'").split())
    memory = name.casefold().endswith("-mem")
    name = _TRACE.sub("", re.sub(r"-(data|mem)$", "", name, flags=re.IGNORECASE), count=1)
    quantity, unit = QUANTITIES.get(_plain(name)), None
    split = None if quantity else _WITH_UNIT.fullmatch(name)
    if split:
        quantity, unit = QUANTITIES.get(_plain(split[1])), next(part for part in split.groups()[1:] if part is not None)
    if quantity is None:
        return None
    return ColumnMeaning(index, quantity, name, _factor(quantity, unit), memory, unit)


def _in_si(page: TextFile, column: ColumnMeaning, numbers: Reals, line: int) -> Reals:
    """Return the numbers of a column in SI units. Raises RecordingError for an unknown unit."""
    if column.in_decibels:
        with np.errstate(over="ignore"):
            return np.asarray(10 ** (numbers / 20), np.float64)
    if column.factor is None:
        says = f"has the unit {clipped(column.unit)!r}" if column.unit else "has no unit"
        units = "Hz, kHz, MHz or GHz" if column.quantity == "f" else f"a unit such as {_BASES[column.quantity][0]}"
        example = _EXAMPLE.get(column.quantity)
        hint = f", for example {example}" if example else ""
        raise page.error(line, f"column {clipped(column.name)!r} {says}; {units} is needed{hint}")
    with np.errstate(over="ignore"):
        return column.factor * numbers


def _plain(name: str) -> str:
    """Return a name in small letters without blanks and accents."""
    letters = unicodedata.normalize("NFKD", name.replace(" ", "").casefold())
    return letters if letters.isascii() else "".join(letter for letter in letters if not unicodedata.combining(letter))


def _factor(quantity: str, unit: str | None) -> float | None:
    """Return the factor to SI units, or None if the unit is not known or a needed unit is missing."""
    bases = _BASES[quantity]
    if not unit:
        return 1.0 if bases[0] in _NO_UNIT_SAID or bases == ("",) else None
    if bases is _ANGLE:
        angle = _plain(unit)
        return None if angle not in bases else 1.0 if angle == "rad" else float(np.pi / 180)
    for base in filter(None, bases):
        if unit.casefold().endswith(base.casefold()):
            prefix = unit[: len(unit) - len(base)]
            if prefix in _PREFIXES and not (quantity == "f" and _PREFIXES[prefix] < 1):  # mHz: 1e-3 or 1e6?
                return _PREFIXES[prefix]
    return None


def pair_of(
    page: TextFile, columns: Sequence[ColumnMeaning], names: Sequence[str], line: int
) -> tuple[str, ColumnMeaning, ColumnMeaning]:
    """Return the measurement parameter that the columns determine, with its two columns. Raises RecordingError.

    `names` are all names of the header, for the error.
    """
    named: dict[str, ColumnMeaning] = {}
    for column in columns:
        if column.quantity in named:
            raise page.error(line, f"two columns give {column.quantity}; one is needed")
        named[column.quantity] = column
    for first, second, parameter in PAIRS:
        if first in named and second in named:
            if parameter in SIGN_LOST:
                raise page.error(line, sign_lost(parameter))
            return parameter, named[first], named[second]
    found = ", ".join(name for name in named if name != "f") or "none"
    needed = "two columns of one kind are needed, such as R_ohm,X_ohm or |Z|_ohm,theta_deg or G_S,B_S"
    if found in ("|Z|", "|Y|"):
        needed = f"the phase is needed beside {found}, for example in a column theta_deg"
    header = ", ".join(clipped(name.strip(' "')) for name in names[:6]) + (", ..." if len(names) > 6 else "")
    raise page.error(
        line,
        f"the columns {header} do not determine an impedance (recognised besides the frequency: {found}); {needed}",
    )


def sign_lost(parameter: str) -> str:
    """Return why a measurement parameter does not determine Z."""
    return (
        f"{SIGN_LOST[parameter]} ({parameter}) do not say whether the device is inductive or capacitive; "
        "record R and X (IRIM) instead"
    )


def points_of(
    page: TextFile,
    columns: Sequence[ColumnMeaning],
    names: Sequence[str],
    body: Sequence[tuple[int, list[str]]],
    line: int,
) -> tuple[Points, list[str]]:
    """Return the points of a table and notes on them. Raises RecordingError.

    `columns` are the columns to use, `names` all names of the header on `line`; `body` holds line number and cells of
    each row.
    """
    parameter, first, second = pair_of(page, columns, names, line)
    frequency = next(column for column in columns if column.quantity == "f")
    taken = (frequency, first, second)
    needed = [column.index for column in taken]
    commas = has_decimal_comma(cells[k] for _, cells in body for k in needed if k < len(cells))
    page = replace(page, decimal_comma=commas)
    table = [page.row(cells, names, n, needed) for n, cells in body]
    numbers = np.array(table, dtype=np.float64).reshape(len(table), len(taken))
    f, a, b = (_in_si(page, column, numbers[:, k], line) for k, column in enumerate(taken))
    notes = notes_on(parameter, a, b)
    bare = [c.quantity for c in (first, second) if c.unit is None and _BASES[c.quantity] != ("",)]
    if bare:
        notes.append(f"Columns {' and '.join(bare)} have no unit; SI units (ohm, siemens) are assumed.")
    return Points([n for n, _ in body], f, to_impedance(parameter, f, a, b)), notes


def of_reflection(names: Sequence[str]) -> bool:
    """Return whether a header has columns of a network analyzer, which measures the reflection."""
    return any(REFLECTION.search(name) for name in names)


def memory_columns(columns: Sequence[ColumnMeaning]) -> list[ColumnMeaning]:
    """Return the columns of the memory trace with the frequency, or none if there is no memory trace."""
    memory = [column for column in columns if column.memory]
    return [column for column in columns if column.quantity == "f"] + memory if memory else []


def data_columns(columns: Sequence[ColumnMeaning]) -> list[ColumnMeaning]:
    """Return the columns of the data trace."""
    return [column for column in columns if not column.memory]


def notes_on(parameter: str, a: Reals, b: Reals) -> list[str]:
    """Return notes on what the numbers of a measurement parameter do not say, or say in an unusual way."""
    notes: list[str] = []
    if parameter in RESISTANCE_WEAK:
        notes.append(
            f"{parameter} gives the resistance as a small difference, assumed to be positive; losses are uncertain."
        )
    if loss_is_signed(parameter, a, b):
        notes.append(f"{parameter[-1]} is written with the sign of the reactance beside it; its size is used.")
    return notes
