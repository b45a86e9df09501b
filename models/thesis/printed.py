"""The numbers of E. S. Tjelde's thesis (NTNU, January 2012) as printed, including misprints.

Signs stand as printed: the thesis writes c (1 - j/Q) in table 4.7 and a positive h'' in table 4.3.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Deviation:
    """A row of table 4.1."""

    name: str
    simulated: float
    datasheet: float
    percent: float


TABLE_4_1 = (
    Deviation("h (1e8 V/m)", 19.861675, 19.8367, 0.13),
    Deviation("eps", 859.8075, 913.73, 5.90),
    Deviation("Z (MRayl)", 34.14, 33.347751048609, 2.38),
    Deviation("c (m/s)", 4434.4415, 4330.87675955961, 2.39),
    Deviation("q", 107.37195, 80, 34.21),
    Deviation("zm2 (MRayl)", 11.1375, 10.3, 8.13),
    Deviation("cm2 (m/s)", 2774.275, 2455, 13.01),
    Deviation("qm2", 23.696125, 60, 60.51),
    Deviation("zm4 (MRayl)", 2.613625, 2.4, 8.90),
    Deviation("cm4 (m/s)", 2159.3, 2250, 4.03),
    Deviation("qm4", 22.081825, 35, 36.91),
)


@dataclass(frozen=True)
class Stiffness:
    """A row of table 4.7: the printed c33 of both columns, and the z, c and q that it should come from."""

    name: str
    simulated: complex
    """Pa, sign of the imaginary part as printed."""
    datasheet: complex
    z_c_q: tuple[float, float, float] | None
    """Rayl, m/s, 1: the means of table 4.1."""
    datasheet_z_c_q: tuple[float, float, float] | None


_GLUE = 6.86e9 - 0.527692307e9j
TABLE_4_7 = (
    Stiffness(
        "PZT", 1.5139e11 - 0.014448e11j, 1.444e11 - 0.01805e11j,
        (34.14e6, 4434.4415, 107.37195), (33.347751048609e6, 4330.87675955961, 80.0),
    ),
    Stiffness("glue 1", 6.86e9 - 0.52769e9j, 6.86e9 - 0.527692e9j, None, None),
    Stiffness(
        "ML1", 3.0921357e10 - 0.144455e10j, 2.52865e10 - 0.04214e10j,
        (11.1375e6, 2774.275, 23.696125), (10.3e6, 2455.0, 60.0),
    ),
    Stiffness("glue 2", _GLUE, _GLUE, None, None),
    Stiffness(
        "ML2", 5.63251e9 - 0.257336601e9j, 5.40e9 - 0.154285714e9j,
        (2.613625e6, 2159.3, 22.081825), (2.4e6, 2250.0, 35.0),
    ),
)  # fmt: skip
SHERRIT_C33D = 1.514575e11 + 0.011626e11j
"""Pa; the stiffness by Sherrit's thickness method (its power of ten is not printed, its sign is that of exp(+jwt))."""
EPS_4_3 = 859.8075 - 9.7584j
"""Relative permittivity, mean of table 4.3."""
H_4_3 = (19.8617 + 0.0980j) * 1e8
"""V/m, mean of table 4.3."""


@dataclass(frozen=True)
class RadialSample:
    """A column of table 4.8, or a set of table A.1, SI units."""

    name: str
    s11E: complex
    s12E: complex
    d31: complex
    eps33T: complex
    c11p: complex
    sigma_p: complex
    kp_IEEE: complex
    """Printed as k^p without a definition."""
    eps33p: complex


TABLE_4_8 = (
    RadialSample(
        "4", (1.4263 - 3.3624e-2j) * 1e-11, (-5.0937 - 3.7083e-1j) * 1e-12, (-155.21 + 8.4805j) * 1e-12,
        (1.5696 - 2.3037e-2j) * 1e-8, (7.0073 + 1.6520e-1j) * 1e10, 0.3563 + 0.0344j, 0.5843 + 0.0023j,
        (1.0444 - 6.1164e-3j) * 1e-8,
    ),
    RadialSample(
        "8", (1.3740 - 1.2521e-2j) * 1e-11, (-6.9973 - 4.8490e-1j) * 1e-12, (-127.60 + 7.6445j) * 1e-12,
        (1.5097 - 1.5490e-2j) * 1e-8, (7.2773 + 6.6313e-2j) * 1e10, 0.5089 + 0.0399j, 0.5954 + 0.0067j,
        (1.0272 - 1.2796e-3j) * 1e-8,
    ),
    RadialSample(
        "12", (1.4332 - 2.4562e-2j) * 1e-11, (-6.4920 - 5.6096e-1j) * 1e-12, (-134.08 + 7.3514j) * 1e-12,
        (1.6312 - 2.1468e-2j) * 1e-8, (6.9752 + 1.1954e-1j) * 1e10, 0.4522 + 0.0469j, 0.5320 + 0.0233j,
        (1.1737 - 1.8252e-2j) * 1e-8,
    ),
)  # fmt: skip
FERROPERM = {"s11E": 16.9555e-12, "s12E": -6.5991e-12, "d31": -169.9915e-12, "sigma_p": 0.3892}
"""Table 4.8, column Ferroperm; 1/Pa, 1/Pa, C/N, 1."""

UNITS_4_9 = {
    "s11E": 1e-11, "s12E": 1e-12, "d31": 1e-12, "eps33T": 1e-8, "c11p": 1e10, "sigma_p": 1.0, "kp_IEEE": 1.0,
    "eps33p": 1e-8,
}  # fmt: skip
"""What one unit of table 4.9 (and of 4.8, A.1) is, SI."""

TABLE_4_9: dict[str, tuple[complex, complex]] = {
    "s11E": (1.4112 - 0.0236j, 0.0324 + 0.0106j),
    "s12E": (-6.1943 - 0.4722j, 0.9861 + 0.0957j),
    "d31": (-138.9633 + 7.8255j, 14.4383 + 0.5859j),
    "eps33T": (1.5702 - 0.0200j, 0.0608 + 0.0040j),
    "c11p": (7.0866 + 0.1170j, 0.1659 + 0.0495j),
    "sigma_p": (0.4391 + 0.0404j, 0.0771 + 0.0063j),
    "kp_IEEE": (0.5706 + 0.0108j, 0.0339 + 0.0111j),
    "eps33p": (1.0818 - 0.0085j, 0.0801 + 0.0087j),
}
"""Mean and standard deviation of real and imaginary part, in the units above."""

TABLE_A_1 = RadialSample(
    "calculated", 1.4628e-11 * (1 - 0.023611j), -5.4894e-12 * (1 - 0.02278j), -205.9e-12 * (1 - 0.03057j),
    2.7337e-8 * (1 - 0.02077j), 6.8343e10 * (1 + 0.01614j), 0.3753 - 0.0025j, 0.5946 - 0.0060j,
    1.8062e-8 * (1 - 0.0062j),
)  # fmt: skip
SHERRIT_A_1 = RadialSample(
    "Sherrit", 1.704e-11 * (1 - 0.01832j), -6.394e-12 * (1 - 0.02496j), -222.5e-12 * (1 - 0.02364j),
    2.740e-8 * (1 - 0.02077j), 6.829e10 * (1 + 0.01614j), 0.3753 * (1 - 0.00664j), 0.5945 * (1 - 0.01013j),
    1.810e-8 * (1 - 0.01450j),
)  # fmt: skip
ERRORS_A_1 = {
    "s11E": (14.15, 10.64), "s12E": (14.15, 21.65), "d31": (7.46, 19.67), "eps33T": (0.23, 0.23),
    "c11p": (0.08, 0.08), "sigma_p": (0.00, 0.32), "kp_IEEE": (0.02, 0.37), "eps33p": (0.21, 57.33),
}  # fmt: skip
"""Printed errors of table A.1 in per cent, real and imaginary."""
