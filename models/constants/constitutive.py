"""The four forms of the linear piezoelectric law, for any number of stress and field components.

With stress T and strain S (n components), field E and displacement D (m components), everything complex:

    strain_E   T = cE S - e^T E      D = e S + epsS E
    stress_E   S = sE T + d^T E      D = d T + epsT E
    strain_D   T = cD S - h^T D      E = -h S + D/epsS
    stress_D   S = sD T + g^T D      E = -g T + D/epsT

One law holds for the full crystal (n = 6, m = 3), the thin disk (2, 1) and the thickness mode (1, 1). Source: IEEE
Std 176-1987, table 5. The thesis (Tjelde, NTNU 2012) prints (2.13a) as E = -gT + D eps^T and (2.14b) as
S = c^E S + eE; both are misprints of the above.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from ..base.arrays import Complexes, Reals

Form: TypeAlias = Literal["strain_E", "stress_E", "strain_D", "stress_D"]
"""Which two of T, S, E, D are independent: the names stand for the independent pair."""


@dataclass(frozen=True, eq=False)
class ConstitutiveLaw:
    """The law in one of its four forms."""

    form: Form
    elastic: Complexes
    """cE, sE, cD or sD; Pa or 1/Pa, shape (n, n)."""
    piezo: Complexes
    """e (C/m2), d (C/N), h (V/m) or g (V m/N), shape (m, n)."""
    dielectric: Complexes
    """epsS for strain forms, epsT for stress forms; F/m, shape (m, m)."""


def _solve(a: Complexes, b: Complexes) -> Complexes:
    return np.linalg.solve(a, b).astype(np.complex128)  # its stub forgets that double stays double


def _inverse(a: Complexes) -> Complexes:
    return _solve(a, np.eye(len(a), dtype=np.complex128))


def _strain_E(law: ConstitutiveLaw) -> ConstitutiveLaw:
    a, p, eps = law.elastic, law.piezo, law.dielectric
    if law.form == "strain_E":
        return law
    if law.form == "strain_D":
        e = eps @ p
        return ConstitutiveLaw("strain_E", a - p.T @ e, e, eps)
    s = a if law.form == "stress_E" else a + p.T @ eps @ p
    d = p if law.form == "stress_E" else eps @ p
    c = _inverse(s)
    return ConstitutiveLaw("strain_E", c, d @ c, eps - d @ c @ d.T)


def convert(law: ConstitutiveLaw, form: Form) -> ConstitutiveLaw:
    """Return the same law in another form. Raises numpy.linalg.LinAlgError where a block is singular."""
    if form == law.form:
        return law
    at = _strain_E(law)
    c, e, epsS = at.elastic, at.piezo, at.dielectric
    if form == "strain_E":
        return at
    if form == "strain_D":
        h = _solve(epsS, e)
        return ConstitutiveLaw(form, c + e.T @ h, h, epsS)
    s = _inverse(c)
    d = e @ s
    epsT = epsS + d @ e.T
    if form == "stress_E":
        return ConstitutiveLaw(form, s, d, epsT)
    g = _solve(epsT, d)
    return ConstitutiveLaw(form, s - d.T @ g, g, epsT)


def loss_matrix(law: ConstitutiveLaw) -> Reals:
    """Return the real symmetric matrix, shape (n + m, n + m), that is positive semidefinite for a passive law.

    It is -Im of [[sE, d^T], [d, epsT]]: the power turned into heat is w/2 times its quadratic form in (T, E).
    R. Holland, IEEE Trans. Sonics Ultrason. SU-14 (1967) 18.
    """
    at = convert(law, "stress_E")
    whole: Complexes = np.block([[at.elastic, at.piezo.T], [at.piezo, at.dielectric]])
    return -whole.imag
