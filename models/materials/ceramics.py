"""Piezoelectric materials: ceramics and one polymer."""

from dataclasses import replace

import numpy as np

from ..build import Quantity
from ..constants.constitutive import ConstitutiveLaw
from ..constants.piezo_constants import EPS0, Radial, Thickness, clamped_permittivity
from ..constants.tensor import Tensor6mm
from .composite import Polymer, composite_1_3
from .material import Material, ceramics, from_tensor, lossless_tensor
from .temperature import permittivity_slope

_THESIS = "Ferroperm data sheet as printed by Tjelde, NTNU 2012"
_FERROPERM = (
    "Ferroperm Piezoceramics, full data matrix of Pz27, rounded; its kp, kt, eps33T and d31 agree with the columns "
    "that Tjelde, NTNU 2012, prints to 2 %"
)
_PZ26 = (
    "Ferroperm Piezoceramics, full data matrix of Pz26, rounded, not read again; its s11E, d31, d33, eps33T, kt and kp "
    "follow from these constants to 1 %; Qm > 1000, tan d 0.003"
)
_BERGEN = "Knappskog, master thesis, University of Bergen 2007: constants of Pz27 adjusted to measured disks"
_KOCBACH = "Kocbach's set, PiezoAcousticFEM.jl"
_PIC = "PI Ceramic, Piezo Material Data (table of the catalogue), scribd.com/document/413108158"
_COMSOL = "COMSOL material library, stress-charge form, as exported in public model files"
_NAVY = "American Piezo Ceramics, table of material properties"
_ERTURK = "Erturk and Inman, Piezoelectric Energy Harvesting, Wiley 2011, table E.1"
_PIEZO_FILM = "Measurement Specialties, Piezo Film Sensors Technical Manual, table 1"
_COMPOSITE = "IEEE TUFFC 64 (2017) 1078, table I (PMC5568756)"
_CTS = "CTS data sheet, dtsheet.com/doc/1396950"


def _pz27() -> dict[str, Quantity]:
    """Pz27 of the thesis: its data-sheet columns, the rest of the matrix from Ferroperm, Qm 80 and tan d 0.017."""
    Q, tan = 80.0, 0.017
    full = lossless_tensor((147, 105, 93.7, 113, 23.0), (-3.09, 16.0, 11.64), (1130, 914), Q, tan)
    printed: dict[str, complex] = {
        "density": 7700,
        "c33D": 144.4e9 * (1 + 1j / Q),
        "h33": 19.8367e8,
        "eps33S": 913.73 * EPS0 * (1 - 1j * tan),
        "s11E": 16.9555e-12 * (1 - 1j / Q),
        "s12E": -6.5991e-12 * (1 - 1j / Q),
        # half the loss angle of s eps, which keeps the planar coupling real
        "d31": -169.9915e-12 * (1 - 0.5j * (1 / Q + tan)),
    }
    return {
        **from_tensor(full, 7700, _FERROPERM),
        **ceramics(printed, _THESIS),
        "eps33T": ceramics({"eps33T": 1795 * EPS0 * (1 - 1j * tan)}, _FERROPERM)["eps33T"],
    }


def _bergen() -> dict[str, Quantity]:
    full = Tensor6mm(
        118.75e9 * (1 + 1j / 95.75),
        74.30e9 * (1 + 1j / 71.24),
        74.25e9 * (1 + 1j / 120.19),
        112.05e9 * (1 + 1j / 177.99),
        21.10e9 * (1 + 1j / 75),
        -5.40 * (1 - 1j / 166),
        16.0389 * (1 - 1j / 323.77),
        11.20 * (1 - 1j / 200),
        916 * EPS0 * (1 - 1j / 50),
        920 * EPS0 * (1 - 1j / 86.28),
    )
    return from_tensor(full, 7700, _BERGEN)


SHERRIT_RADIAL = Radial(
    s11E=17.04e-12 * (1 - 0.01832j),
    s12E=-6.394e-12 * (1 - 0.02496j),
    d31=-222.5e-12 * (1 - 0.02364j),
    eps33T=2.740e-8 * (1 - 0.02077j),
)
"""The sample of Sherrit's radial paper, as the thesis's table A.1 prints it."""


def _sherrit() -> dict[str, Quantity]:
    constants = {name: getattr(SHERRIT_RADIAL, name) for name in ("s11E", "s12E", "d31", "eps33T")}
    return ceramics(constants, "Sherrit et al., Ferroelectrics 119 (1991), as printed in the thesis, table A.1")


def _pzt5h() -> dict[str, Quantity]:
    plate = Thickness(177e9 * (1 + 0.023j), 2.19e9 * (1 + 0.029j), 1.06e-8 * (1 - 0.053j))
    values: dict[str, complex] = {"density": 7800, "c33D": plate.c33D, "h33": plate.h33, "eps33S": plate.eps33S}
    return ceramics(values, "Motorola 3203HD, Sherrit, Leary, Dolgin, Bar-Cohen, IEEE Ultrasonics Symposium 1999")


def _catalogue(
    density: float,
    eps_r: float,
    kp: float,
    kt: float,
    d31_pC_N: float,
    s11E: float | None,
    Q: float,
    tan: float,
    source: str,
) -> dict[str, Quantity]:
    """Return what a catalogue's couplings determine: eps33S of both couplings, s12E from kp, no c33D."""
    eps33T = eps_r * EPS0 * (1 - 1j * tan)
    d31 = d31_pC_N * 1e-12 * (1 - 0.5j * (1 / Q + tan))
    values: dict[str, complex] = {"density": density, "eps33T": eps33T, "d31": d31}
    values["eps33S"] = clamped_permittivity(eps33T, kp, kt)
    if s11E is not None:
        s11 = s11E * 1e-12 * (1 - 1j / Q)
        values |= {"s11E": s11, "s12E": 2 * d31**2 / (eps33T * kp**2) - s11}
    return ceramics(values, source)


def _navy(
    stiffness: tuple[float, float, float, float, float],
    e: tuple[float, float, float],
    eps: tuple[float, float],
    type_and_losses: tuple[str, float, float],
) -> dict[str, Quantity]:
    """Return a ceramic of the library of COMSOL, with Qm and tan d of the same Navy type."""
    navy, Q, tan = type_and_losses
    losses = f"Qm {Q:g} and tan d {tan:g} of Navy type {navy}: {_NAVY}"
    return from_tensor(
        lossless_tensor(stiffness, e, eps, Q, tan), 7500 if navy == "I" else 7600, f"{_COMSOL}; {losses}"
    )


def _pz26() -> dict[str, Quantity]:
    """Return Pz26 from its ten constants; the compliances, d and eps33T that the data sheet prints too agree to 1 %."""
    full = lossless_tensor((168, 110, 99.9, 123, 30.1), (-2.80, 14.7, 9.86), (828, 700), 1000, 0.003)
    return from_tensor(full, 7700, _PZ26)


def _compliances(
    s: tuple[float, float, float, float, float],
    d: tuple[float, float, float],
    eps_T: tuple[float, float],
    losses: tuple[float, float],
) -> Tensor6mm:
    """Return a tensor from a source's s11 s12 s13 s33 s55 in pm2/N, d31 d33 d15 in pC/N, eps11T eps33T in eps0."""
    s11, s12, s13, s33, s55 = (1e-12 * value for value in s)
    compliance = np.diag([s11, s11, s33, s55, s55, 2 * (s11 - s12)]).astype(complex)
    compliance[0, 1] = compliance[1, 0] = s12
    compliance[:2, 2] = compliance[2, :2] = s13
    charge = np.zeros((3, 6), complex)
    charge[2, :2], charge[2, 2], charge[0, 4], charge[1, 3] = (1e-12 * value for value in (d[0], d[1], d[2], d[2]))
    eps = (EPS0 * np.diag([eps_T[0], eps_T[0], eps_T[1]])).astype(complex)
    real = Tensor6mm.from_law(ConstitutiveLaw("stress_E", compliance, charge, eps))
    c = (real.c11E, real.c12E, real.c13E, real.c33E, real.c44E)
    c11, c12, c13, c33, c44 = (value.real / 1e9 for value in c)
    e = (real.e31.real, real.e33.real, real.e15.real)
    return lossless_tensor((c11, c12, c13, c33, c44), e, (real.eps11S.real, real.eps33S.real), *losses)


_PZT5H_FULL = _compliances((16.5, -4.78, -8.45, 20.7, 43.5), (-274, 593, 741), (3130, 3400), (65, 0.025))


def _piezo_film() -> dict[str, Quantity]:
    """Return PVDF film of the maker's manual: kt 14 %, 2200 m/s in thickness, eps 12 to 13, tan d 0.02 at 1 kHz."""
    c33D = 1780 * 2200**2 * (1 + 1j / 10)
    eps33S = 12.5 * EPS0 * (1 - 0.14**2) * (1 - 0.02j)
    plate = Thickness.from_coupling(c33D, -0.14, eps33S)
    values = {"density": 1780 + 0j, "c33D": c33D, "h33": plate.h33.real + 0j, "eps33S": eps33S}
    source = f"{_PIEZO_FILM}: kt, speed; permittivity and tan d at 1 kHz; Q 10 assumed"
    wide = {"eps33S": (0.3, 1.0), "c33D": (0.1, 0.5), "h33": (0.2, 0.0), "density": (0.01, 0.0)}
    return {
        name: Quantity(value.real, value.imag, wide[name][0] * abs(value.real), wide[name][1] * abs(value.imag), source)
        for name, value in values.items()
    }


def _published_composite() -> dict[str, Quantity]:
    """Return a 1-3 composite of PZT-5H in epoxy as built: 19.8 MRayl, 3740 m/s, kt 0.65, eps33S 660."""
    c33D, eps33S = 19.8e6 * 3740 * (1 + 1j / 30), 660 * EPS0 * (1 - 0.025j)
    plate = Thickness.from_coupling(c33D, 0.65, eps33S)
    values = {"density": 19.8e6 / 3740 + 0j, "c33D": c33D, "h33": plate.h33.real + 0j, "eps33S": eps33S}
    return ceramics(values, f"{_COMPOSITE}: impedance, speed, kt, eps33S; Q 30 and tan d 0.025 assumed")


def _mixed_composite() -> dict[str, Quantity]:
    """Return half PZT-5H, half epoxy, by the mixing rules; the epoxy of the published composite."""
    c11 = 3.1e6 * 2680 * (1 + 1j / 30)
    epoxy = Polymer(c11, c11 * 0.35 / 0.65, 4 * EPS0, 3.1e6 / 2680)
    density, plate = composite_1_3(_PZT5H_FULL, 7500, epoxy, 0.5)
    values = {"density": density + 0j, "c33D": plate.c33D, "h33": plate.h33, "eps33S": plate.eps33S}
    source = f"Smith and Auld, IEEE TUFFC 38 (1991) 40, from PZT-5H: {_ERTURK}, and epoxy: {_COMPOSITE}"
    mixed = ceramics(values, f"{source}; Poisson's ratio 0.35, permittivity 4 and Q 30 of the epoxy assumed")
    eps33S = mixed["eps33S"]  # half of the difference to the published composite, in place of a maker's tolerance
    return {**mixed, "eps33S": replace(eps33S, u=0.2 * eps33S.re)}


def _pvdf() -> dict[str, Quantity]:
    values: dict[str, complex] = {
        "density": 1880,
        "c33D": 1.13e10 * (1 + 0.04j),
        "h33": -4.7e9,
        "eps33S": 4.692e-11 * (1 - 0.14j),
    }
    return ceramics(values, "nominal values published with xMason, IEEE ISAF 2022")


def _li() -> dict[str, Quantity]:
    s11E, eps33T, d31 = 16.31e-12 * (1 - 0.012j), 1.610e-8 * (1 - 0.014j), -201e-12 * (1 - 0.018j)
    return ceramics(
        {"density": 7743, "s11E": s11E, "s12E": -0.318 * s11E, "eps33T": eps33T, "d31": d31},
        "thin-disk fit of the recording of Li et al., IEEE TUFFC 68 (2021) 3446; misfit 1.1 % at 0.01 % noise",
    )


CERAMICS: tuple[Material, ...] = (
    Material("Pz27", "piezo", _pz27(), "soft PZT; thickness and radial constants as the thesis prints them"),
    Material("Pz26", "piezo", _pz26(), "hard PZT; Navy type I"),
    Material("Pz27 Bergen", "piezo", _bergen(), "complete complex set; passive"),
    Material(
        "PZT-5A",
        "piezo",
        from_tensor(
            lossless_tensor((121, 75.4, 75.2, 111, 22.6), (-5.4, 15.8, 12.3), (916, 830), 75, 0.02),
            7750,
            f"{_KOCBACH}; Q 75 and tan d 0.02 are usual for the class",
        ),
    ),
    Material("PZT-5H", "piezo", _pzt5h(), "thickness mode only"),
    Material(
        "PZT-5A Erturk",
        "piezo",
        from_tensor(
            _compliances((16.4, -5.74, -7.22, 18.8, 47.5), (-171, 374, 584), (1730, 1700), (80, 0.02)),
            7750,
            f"{_ERTURK}; Qm 80 and tan d 0.02 of Navy type II: {_NAVY}",
        ),
        "complete set of compliances",
    ),
    Material(
        "PZT-5H Erturk",
        "piezo",
        from_tensor(_PZT5H_FULL, 7500, f"{_ERTURK}; Qm 65 and tan d 0.025 of Navy type VI: {_NAVY}"),
        "complete set of compliances",
    ),
    Material(
        "PZT-4",
        "piezo",
        _navy(
            (138.999, 77.8366, 74.2836, 115.412, 25.641),
            (-5.20279, 15.0804, 12.7179),
            (762.5, 663.2),
            ("I", 500, 0.006),
        ),
        "hard; Navy type I",
    ),
    Material(
        "PZT-8",
        "piezo",
        _navy(
            (146.876, 81.087, 81.0537, 131.712, 31.348),
            (-3.87538, 13.9108, 10.3448),
            (904.4, 561.6),
            ("III", 1000, 0.004),
        ),
        "hard; Navy type III",
    ),
    Material("PVDF", "piezo", _piezo_film(), "film; thickness mode only"),
    Material("1-3 composite PZT-5H", "piezo", _published_composite(), "as published; thickness mode only"),
    Material("1-3 composite PZT-5H 50%", "piezo", _mixed_composite(), "by mixing rules; thickness mode only"),
    Material("Sherrit radial", "piezo", _sherrit(), "radial mode only; density not printed"),
    Material("CTS 3195HD", "piezo", _catalogue(7800, 1900, 0.65, 0.48, -190, None, 80, 0.018, _CTS), "no stiffness"),
    Material("CTS 3203HD", "piezo", _catalogue(7870, 3800, 0.75, 0.55, -320, None, 30, 0.020, _CTS), "no stiffness"),
    Material(
        "PIC255",
        "piezo",
        from_tensor(
            lossless_tensor((119, 84, 83, 117, 21), (-6.03, 15.49, 12.09), (8.15e-9, 6.58e-9), 127, 0.02),
            7800,
            "University of Paderborn, plutho; Q 127 is its viscous law at 2 MHz, tan d 0.02 usual for the class",
        ),
        temperature=permittivity_slope(4e-3, _PIC),
    ),
    Material(
        "PIC184",
        "piezo",
        from_tensor(
            lossless_tensor((141.5, 86.2, 79.9, 124.9, 26.8), (-4.00, 13.17, 13.8), (1.087e-8, 5.64e-9), 155, 0.005),
            7850,
            "University of Paderborn, plutho; Q 155 is its viscous law at 2 MHz, tan d 0.005 usual for the class",
        ),
    ),
    Material(
        "PIC155",
        "piezo",
        _catalogue(7800, 1450, 0.62, 0.48, -165, 15.6, 80, 0.020, _PIC),
        "no c33D",
        permittivity_slope(6e-3, _PIC),
    ),
    Material("PIC181", "piezo", _catalogue(7800, 1200, 0.56, 0.46, -120, 11.8, 2000, 0.003, _PIC), "no c33D"),
    Material(
        "NCE51",
        "piezo",
        from_tensor(
            lossless_tensor((134, 88.9, 90.9, 121, 20.5), (-6.06, 17.2, 13.7), (906, 823), 100, 0.01),
            7850,
            "Noliac NCE51, public finite-element script; loss 1 %",
        ),
    ),
    Material("Li 2021 disk", "piezo", _li(), "radial mode only"),
    Material("P(VDF-TrFE)", "piezo", _pvdf(), "screen-printed film"),
)
"""Every piezoelectric material of the library."""
