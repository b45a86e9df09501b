"""Piezoelectric materials: ceramics and one polymer."""

from ..build import Quantity
from ..constants.piezo_constants import EPS0, Radial, Thickness, clamped_permittivity
from ..constants.tensor import Tensor6mm
from .material import Material, ceramics, from_tensor, lossless_tensor

_THESIS = "Ferroperm data sheet as printed by Tjelde, NTNU 2012"
_FERROPERM = (
    "Ferroperm Piezoceramics, full data matrix of Pz27, rounded; its kp, kt, eps33T and d31 agree with the columns "
    "that Tjelde, NTNU 2012, prints to 2 %"
)
_BERGEN = "Knappskog, master thesis, University of Bergen 2007: constants of Pz27 adjusted to measured disks"
_KOCBACH = "Kocbach's set, PiezoAcousticFEM.jl"
_PIC = "PI Ceramic, Piezo Material Data (table of the catalogue), scribd.com/document/413108158"
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
    Material("PIC155", "piezo", _catalogue(7800, 1450, 0.62, 0.48, -165, 15.6, 80, 0.020, _PIC), "no c33D"),
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
