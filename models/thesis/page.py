"""The page `docs/thesis.md`, as text."""

import math
from collections.abc import Iterable, Sequence

from ..constants.passivity import passivity_margin
from ..constants.piezo_constants import EPS0, Thickness
from ..materials import find
from . import printed, rebuilt
from .errata import errata

_INTRODUCTION = """# The thesis, recomputed

E. S. Tjelde, *Model based estimation of the complex material constants for thickness extension and radial mode in an
ultrasound disk transducer*, NTNU 2012. Every number below the heading "printed" is the thesis's own; all others are
computed from those by this program. This page is written by `pzctl.models.thesis` and checked by the tests: do not
edit it.

Lossy stiffness is c (1 + j/Q), lossy permittivity eps (1 - j tan d), for exp(+jwt).
"""


def number(value: float, digits: int = 5) -> str:
    """Return a number with this many significant digits."""
    return f"{value:.{digits}g}"


def complex_number(value: complex, digits: int = 5) -> str:
    """Return `1.4263 - 0.033624j`, each part with this many significant digits."""
    sign = "-" if value.imag < 0 else "+"
    return f"{number(value.real, digits)} {sign} {number(abs(value.imag), digits)}j"


def percent(found: float, reference: float) -> str:
    """Return the deviation in per cent with its sign."""
    return f"{100 * (found / reference - 1):+.2f} %"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _table_4_1() -> str:
    rows = [
        [
            row.name,
            number(row.simulated, 7),
            number(row.datasheet, 7),
            f"{row.percent:.2f} %",
            f"{100 * abs(row.simulated / row.datasheet - 1):.2f} %",
        ]
        for row in printed.TABLE_4_1
    ]
    text = "The printed deviations are right; their signs are lost. `Z` and `c` carry the stiffness, see table 4.7.\n\n"
    return text + table(["", "simulated", "data sheet", "deviation, printed", "deviation, computed"], rows)


def _stiffness(z_c_q: tuple[float, float, float] | None) -> str:
    if z_c_q is None:
        return "held fixed"
    z, c, q = z_c_q
    return complex_number(z * c * (1 + 1j / q) / 1e9)


def _table_4_7() -> str:
    rows = [
        [
            row.name,
            complex_number(row.simulated / 1e9),
            _stiffness(row.z_c_q),
            complex_number(row.datasheet / 1e9),
            _stiffness(row.datasheet_z_c_q),
        ]
        for row in printed.TABLE_4_7
    ]
    pzt = printed.TABLE_4_7[0]
    as_printed = Thickness(pzt.simulated, printed.H_4_3, printed.EPS_4_3 * EPS0)
    text = (
        "c33 = Z c (1 + j/Q) in GPa, from the means of table 4.1. The printed sign is that of exp(-jwt). Means of "
        "products are not products of means: hence the small differences of the simulated column. Its loss for the PZT "
        f"means Q {-pzt.simulated.real / pzt.simulated.imag:.1f}, where table 4.1 says 107.4: a mean of 1/Q is not one "
        "over the mean. The glue's constants were held, so they agree with themselves.\n\n"
    )
    end = (
        f"\nWith the h and eps of table 4.3 the printed stiffness makes energy (least eigenvalue of the loss matrix "
        f"{passivity_margin(as_printed.law):.4f}); with c (1 + j/Q) and h' - jh'' it is passive "
        f"({passivity_margin(_passive(as_printed).law):+.4f}). By Sherrit's method the thesis finds "
        f"{complex_number(printed.SHERRIT_C33D / 1e9)} GPa, Q {Thickness(printed.SHERRIT_C33D, 1, 1).Qm:.1f}, "
        "with the sign of exp(+jwt) and without its power of ten.\n"
    )
    head = ["GPa", "simulated, printed", "computed", "data sheet, printed", "computed"]
    return text + table(head, rows) + end


def _passive(constants: Thickness) -> Thickness:
    return Thickness(constants.c33D.conjugate(), constants.h33.conjugate(), constants.eps33S)


def _radial_table(sample: printed.RadialSample, truth: printed.RadialSample | None = None) -> str:
    wrong, right = rebuilt.thesis_formulas(sample), rebuilt.corrected(sample)
    rows: list[list[str]] = []
    for name, unit in printed.UNITS_4_9.items():
        value, correct = getattr(sample, name) / unit, getattr(right, name) / unit
        row = [name, number(unit, 1), complex_number(value)]
        row.append(complex_number(wrong[name] / unit) if name in wrong else "")
        row.append(complex_number(correct))
        if truth is not None:
            true = getattr(truth, name) / unit
            row += [complex_number(true), percent(correct.real, true.real), percent(correct.imag, true.imag)]
        rows.append(row)
    rows.append(["kp", "1", "not given", "", complex_number(right.kp), *([""] * 3 if truth else [])])
    head = ["", "unit", "printed", "by the thesis's formulas", "by the right formulas"]
    head += ["Sherrit", "error, real", "error, imaginary"] if truth else []
    return table(head, rows)


def _table_4_8() -> str:
    parts = [
        "s11E is 1/[c11p (1 - sigma_p^2)] and s12E -sigma_p s11E; the thesis has 1/c11p and -sigma_p/c11p. Its d31 "
        "takes over the same error. k^p of the paper is not the data sheet's kp: the last row has that one. The "
        "right-hand column comes from the printed c11p, sigma_p, k^p and eps33T alone.\n"
    ]
    for sample in printed.TABLE_4_8:
        right = rebuilt.corrected(sample)
        implied = rebuilt.implied_coupling(sample)
        parts.append(f"\n### Sample {sample.name}\n\n" + _radial_table(sample))
        parts.append(
            f"\nNot passive as printed: Im(s11E - s12E) is {(sample.s11E - sample.s12E).imag * 1e13:+.2f}e-13 /Pa and "
            f"must not be positive; the right formulas do not cure it (margin {passivity_margin(right.law):.3f}): the "
            "critical frequencies were read from a grid of 6.25 kHz. "
            f"The printed eps33T and eps33p imply k^p = {complex_number(implied, 4)}.\n"
        )
    return "".join(parts)


def _table_4_9() -> str:
    as_printed, right = rebuilt.table_4_9(right=False), rebuilt.table_4_9(right=True)
    rows: list[list[str]] = []
    for name, (mean, deviation) in printed.TABLE_4_9.items():
        unit = printed.UNITS_4_9[name]
        row = [name, number(unit, 1), complex_number(mean), complex_number(deviation, 3)]
        for there in (as_printed, right):
            row += [complex_number(there[name][0] / unit), complex_number(there[name][1] / unit, 3)]
        reference = printed.FERROPERM.get(name)
        row.append(percent(right[name][0].real, reference) if reference else "")
        rows.append(row)
    head = ["", "unit", "mean, printed", "deviation", "of the printed columns", "deviation"]
    head += ["of the right values", "deviation", "right mean against Ferroperm"]
    text = (
        "The scatter of three samples, which is no measurement uncertainty: neither noise nor model error is in it. "
        f"By the printed numbers s11E differs from Ferroperm's by "
        f"{percent(as_printed['s11E'][0].real, printed.FERROPERM['s11E'])} and d31 by "
        f"{percent(as_printed['d31'][0].real, printed.FERROPERM['d31'])}; most of it was the formula.\n\n"
    )
    return text + table(head, rows)


def _table_a_1() -> str:
    error = printed.ERRORS_A_1["s11E"]
    text = (
        "The thesis's program on Sherrit's published sample. With the right formulas all constants return to their "
        f"published values. The printed errors of s11E ({error[0]} and {error[1]} %) mix up two things: the printed "
        "loss 0.023611 is the imaginary part itself, not relative to the real part.\n\n"
    )
    return text + _radial_table(printed.TABLE_A_1, printed.SHERRIT_A_1)


def _recovery(rows: Iterable[rebuilt.Recovery]) -> str:
    def line(row: rebuilt.Recovery) -> list[str]:
        unit = 10 ** math.floor(math.log10(abs(row.truth)))
        return [
            row.name,
            number(unit, 1),
            complex_number(row.truth / unit),
            complex_number(row.found / unit),
            percent(row.found.real, row.truth.real),
            percent(row.found.imag, row.truth.imag) if row.truth.imag else "",
        ]

    return table(["", "unit", "put in", "found", "error, real", "error, imaginary"], (line(row) for row in rows))


def _proof() -> str:
    values = find("PZT-5H").values
    plate = Thickness(*(values[name].value for name in ("c33D", "h33", "eps33S")))
    return (
        "Constants become a noise-free spectrum by the exact model; the critical frequencies of Y/w and wZ give them "
        "back. What remains is the error of the closed forms themselves.\n\n### Radial: Sherrit's sample of 1991\n\n"
        + _recovery(rebuilt.recovered_radial())
        + "\n### Thickness: PZT-5H, Q 43\n\n"
        + _recovery(rebuilt.recovered_thickness(plate))
    )


def _errata() -> str:
    return table(["where", "printed", "correct", "proof"], ([e.where, e.printed, e.correct, e.proof] for e in errata()))


def page() -> str:
    """Return the whole page in Markdown."""
    parts = {
        "Table 4.1: the simulated constants against the data sheet": _table_4_1(),
        "Table 4.7: stiffness": _table_4_7(),
        "Table 4.8: radial constants of three samples": _table_4_8(),
        "Table 4.9: their mean and scatter": _table_4_9(),
        "Table A.1: the program against the paper": _table_a_1(),
        "There and back: Sherrit's constants as spectra": _proof(),
        "Errata": _errata(),
    }
    return _INTRODUCTION + "".join(f"\n## {title}\n\n{text}" for title, text in parts.items())
