"""The thesis's errors, each shown from its own numbers."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import j0, j1

from ..constants.passivity import passivity_margin
from ..constants.piezo_constants import EPS0, Radial, Thickness, clamped_permittivity
from ..constants.sherrit import coupling_squared
from ..materials import Material, find
from . import printed, rebuilt


@dataclass(frozen=True)
class Erratum:
    """One error: its place, the printed and the correct version, and the evidence."""

    where: str
    printed: str
    correct: str
    proof: str


_PLAIN = (
    Erratum(
        "section 2.1.1",
        "backing of higher impedance than the crystal",
        "comparable or lower",
        "higher turns half-wave into quarter-wave operation",
    ),
    Erratum("Table 2.1: z", "electrical impedance", "specific acoustic impedance", "its unit is MRayl"),
    Erratum("(2.13a)", "E = -gT + D eps^T", "E = -gT + D/eps^T", "dimension; compare (2.15a)"),
    Erratum("(2.14b)", "S = c^E S + eE", "T = c^E S - eE", "dimension; compare (2.15b)"),
    Erratum(
        "(2.16), (2.17)",
        "f_-1/2 - f_+1/2",
        "the same, +1/2 being the maximum",
        "for exp(+jwt) the maximum is the lower one",
    ),
    Erratum("(2.19)", "4 rho (f_p^1)^2 t^2/n^2", "4 rho (f_p^n)^2 t^2/n^2, complex", "the order must be the same"),
    Erratum("(2.26)", "c_c = eps''/eps' = tan d", "c_c = c/(1 - j alpha); tan d = eps''/eps'", "two statements in one"),
    Erratum("(3.2)", "a complex error", "its squared size", "the optimiser takes a real number"),
    Erratum(
        "listing of the objective",
        "sum((2*pi*f)).^2.*(...)",
        "sum((2*pi*f).^2.*(...))",
        "as grouped it squares a sum of frequencies and returns a vector",
    ),
    Erratum("section 3.5", "the radial paper is of 1992", "1991", "Ferroelectrics 119; 1992 is the thickness paper"),
    Erratum(
        "section 4.1.2",
        "an error of 0 proves the global minimum",
        "it proves nothing",
        "data of the same model, started beside the answer",
    ),
    Erratum("Table 4.3: imaginary part of Z", "34.1400", "none", "copy of the real part"),
    Erratum(
        "Tables 4.3-4.6, 4.9",
        "uncertainty",
        "scatter between samples",
        "three or four samples; no error of measurement or model is in it",
    ),
)


def _thickness(material: Material) -> Thickness:
    return Thickness(*(material.values[name].value for name in ("c33D", "h33", "eps33S")))


def _radial(material: Material) -> Radial:
    return Radial(*(material.values[name].value for name in ("s11E", "s12E", "d31", "eps33T")))


def _formula_errors() -> list[Erratum]:
    a1 = printed.TABLE_A_1
    wrong, right = rebuilt.thesis_formulas(a1), rebuilt.corrected(a1)
    means, printed_means = rebuilt.table_4_9(right=True), rebuilt.table_4_9(right=False)
    ferroperm = printed.FERROPERM

    def against(name: str) -> str:
        old, new = (table[name][0].real / ferroperm[name] - 1 for table in (printed_means, means))
        return f"mean {100 * new:+.1f} % of Ferroperm's instead of {100 * old:+.1f} %"

    return [
        Erratum(
            "Tables 4.8, 4.9, A.1: s11E",
            "1/c11p",
            "1/[c11p (1 - sigma_p^2)]",
            f"1/c11p of A.1 is {wrong['s11E'].real * 1e11:.4f}e-11, the printed digits; right is "
            f"{right.s11E.real * 1e11:.4f}e-11, Sherrit's 1.704e-11; {against('s11E')}",
        ),
        Erratum(
            "the same, s12E",
            "-sigma_p/c11p",
            "-sigma_p/[c11p (1 - sigma_p^2)]",
            f"-sigma_p/c11p of A.1 is {wrong['s12E'].real * 1e12:.4f}e-12, the printed digits; right is "
            f"{right.s12E.real * 1e12:.3f}e-12, Sherrit's -6.394e-12",
        ),
        Erratum(
            "the same, d31",
            "from the wrong s11E + s12E",
            "from the right one",
            f"the wrong sum gives {wrong['d31'].real * 1e12:.2f} pC/N, printed -205.9; the right one "
            f"{right.d31.real * 1e12:.2f}, Sherrit -222.5; {against('d31')}",
        ),
    ]


def _table_errors() -> list[Erratum]:
    a1, sherrit = printed.TABLE_A_1, printed.SHERRIT_A_1
    s11E = 1 / a1.c11p
    implied = rebuilt.implied_coupling(a1)
    violation = [f"{(s.s11E - s.s12E).imag * 1e13:+.2f}" for s in printed.TABLE_4_8]
    kp = [f"{rebuilt.corrected(s).kp.real:.3f}" for s in printed.TABLE_4_8]
    pzt = printed.TABLE_4_7[0]
    law = Thickness(pzt.simulated, printed.H_4_3, printed.EPS_4_3 * EPS0).law
    return [
        Erratum(
            "Table A.1: loss of s11E",
            "0.023611",
            f"{-s11E.imag / s11E.real:.5f}",
            f"0.023611 is -Im s11E in 1e-11 ({-s11E.imag * 1e11:.5f}), printed as if it were relative; its error is "
            f"{100 * abs(s11E.imag / sherrit.s11E.imag - 1):.1f} %, not 10.64 %",
        ),
        Erratum(
            "Table A.1: losses of eps33p and d31",
            "0.0062, 0.03057",
            f"{-rebuilt.corrected(a1).eps33p.imag / rebuilt.corrected(a1).eps33p.real:.4f}, "
            f"{-rebuilt.corrected(a1).d31.imag / rebuilt.corrected(a1).d31.real:.4f}",
            f"the printed eps33p implies k^p = {implied.real:.4f} {implied.imag:+.4f}j, printed 0.5946 - 0.0060j",
        ),
        Erratum(
            "Table 4.8: k^p",
            "not defined",
            "the coupling of IEEE Std 176, not the data sheet's kp",
            f"kp of the three samples is {', '.join(kp)}",
        ),
        Erratum(
            "Table 4.8: all samples",
            "losses",
            "cannot be a material's",
            f"Im(s11E - s12E) of the printed numbers is {', '.join(violation)} e-13 and must not be positive",
        ),
        Erratum(
            "Table 4.7 with 4.3",
            "c' - jc'', eps' - j eps''",
            "c' + jc''",
            f"the printed pair makes energy: least eigenvalue of the loss matrix {passivity_margin(law):.4f}",
        ),
        Erratum(
            "Table 4.2",
            "tolerances around 19.80 and 914; q +-2.5 %",
            "around 19.8367 and 913.73; Q scatters by tens of per cent",
            f"0.95 x 19.8367 = {0.95 * 19.8367:.2f}, printed 18.81; 0.9 x 913.73 = {0.9 * 913.73:.1f}, printed 822.6",
        ),
    ]


def _radial_equation_errors() -> list[Erratum]:
    pz27 = find("Pz27")
    plate, disk = _thickness(pz27), _radial(pz27)
    clamped = clamped_permittivity(disk.eps33T, disk.kp, plate.kt).real / EPS0
    half = disk.eps33T.real * (1 - plate.kt.real**2) / EPS0
    sigma = disk.sigma_p.real
    one, two = (brentq(lambda eta: eta * j0(eta) - (1 - sigma) * j1(eta), low, low + 1.5) for low in (1.5, 4.5))
    return [
        Erratum(
            "(2.3) for the radial mode",
            "f = n v/2D, n odd",
            "f = eta_n v_p/(pi D)",
            f"Pz27: eta = {one:.3f}, {two:.3f}; the fundamental lies at {one / math.pi:.3f} v_p/D instead of 0.5, "
            f"the overtone ratio is {two / one:.2f} instead of 3",
        ),
        Erratum(
            "(2.4)",
            "eps^S = eps^T (1 - kt^2)",
            "eps33S = eps33T (1 - kp^2)(1 - kt^2)",
            f"Pz27: {half:.0f} against {clamped:.0f} eps0; data sheet 914",
        ),
    ]


def _thickness_equation_errors() -> list[Erratum]:
    plate = _thickness(find("Pz27"))
    kt = plate.kt.real
    X = brentq(lambda X: X - kt**2 * math.tan(X), 0.1, math.pi / 2 - 1e-9)  # the lossless resonance
    ratio = X / (math.pi / 2)
    return [
        Erratum(
            "(2.18)",
            "(pi/2) tan[(pi/2)(fp - fs)/fp]",
            "times fs/fp, both complex",
            f"kt^2 of Pz27 comes out {100 * (1 / ratio - 1):.0f} % too large; with the factor kt = "
            f"{math.sqrt(coupling_squared(ratio, 1).real):.4f}, put in {kt:.4f}",
        ),
        Erratum(
            "(2.20)",
            "Zc (1 - 1/Q)",
            "Zc (1 + j/Q)",
            f"as printed it is real: {plate.c33D.real * (1 - 1 / plate.Qm) / 1e9:.1f} GPa for Pz27",
        ),
        Erratum(
            "(2.21), (2.23)",
            "c' (1 - j/Q)",
            "c' (1 + j/Q), alpha = 1/(2Q)",
            "exp[-j(w/c)(1 - j alpha)z] has c* = c'/(1 - j alpha)^2; alpha = 1/160 gives Q = "
            f"{_quality_of(1 / 160):.1f} with Im c* > 0",
        ),
        Erratum("(3.4)", "eps = jt/(wAZ)", "eps = t/(jwAZ)", f"Z = t/(jwA eps) gives {_sign_of_3_4():+.0f} eps"),
        Erratum("section 3.1", "6.24 and 18.72 kHz", "6.25 and 18.75 kHz", f"5 MHz/800 = {5e6 / 800 / 1e3:.2f} kHz"),
    ]


def _quality_of(alpha: float) -> float:
    c = 1 / (1 - 1j * alpha) ** 2
    return c.real / c.imag


def _sign_of_3_4() -> float:
    eps, w = 8e-9, 2 * math.pi * 1e6
    Z = 1 / (1j * w * eps)
    return float(np.round((1j / (w * Z)).real / eps))


def errata() -> list[Erratum]:
    """Return every error that numbers or dimensions prove."""
    return [*_formula_errors(), *_table_errors(), *_radial_equation_errors(), *_thickness_equation_errors(), *_PLAIN]
