"""The thickness mode of a plate cut at any angle from a crystal, from the crystal's full constants."""

import math

import numpy as np

from ..base.arrays import Reals
from ..constants.piezo_constants import Thickness


def longitudinal_mode(cE: Reals, e: Reals, epsS: Reals, angle_deg: float) -> Thickness:
    """Return the quasi-longitudinal thickness mode of a Y-cut plate, rotated about X by `angle_deg` towards Z.

    The piezoelectrically stiffened Christoffel equation (Auld, Acoustic Fields and Waves in Solids, 1973, chapter 8):
    the plane wave along the normal with the largest share of motion along it. cE (6, 6) in Pa, e (3, 6) in C/m2, epsS
    (3, 3) in F/m, without loss. Exact for a wide plate as far as the other two modes are not excited.
    """
    y, z = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    normal = np.array([0.0, y, z])
    strain = np.array([[0, 0, 0], [0, y, 0], [0, 0, z], [0, z, y], [z, 0, 0], [y, 0, 0]], float)
    piezo, eps = normal @ e @ strain, float(normal @ epsS @ normal)
    stiffened, motions = np.linalg.eigh(strain.T @ cE @ strain + np.outer(piezo, piezo) / eps)
    k = int(np.argmax(np.abs(normal @ motions)))
    motion = motions[:, k] * np.sign(normal @ motions[:, k])
    return Thickness(complex(stiffened[k]), complex(piezo @ motion) / eps, complex(eps))
