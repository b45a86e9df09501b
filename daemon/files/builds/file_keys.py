"""Every key of build.toml and materials.toml, with unit, range, default and meaning: for reading, guide and schema."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from ....models import materials
from ....models.build import NEEDED
from ....models.constants.piezo_constants import EPS0
from ....models.metadata import NUMBER_KEYS, TEXT_KEYS
from ....models.specification import USUAL_CONFORMANCE
from ....models.sweep_plan import BANDWIDTHS, USUAL_POINTS, SweepPlan

Kind: TypeAlias = Literal["text", "texts", "number", "integer", "table", "tables"]


@dataclass(frozen=True)
class Key:
    """The constant that a key gives, and its unit."""

    name: str
    """The constant's name in a LayerSpec."""
    factor: float
    """Value in SI units = number in the file times this."""
    unit: str = ""


@dataclass(frozen=True)
class Entry:
    """A key that gives something else than a constant: a text, a setting, a table."""

    kind: Kind
    about: str
    unit: str = ""
    default: str | float | None = None
    """Value if the key is left out; None if there is none."""
    needed: bool = False
    allowed: str = ""
    """The allowed values as part of a sentence: `a positive number`."""
    least: float | None = None
    """Lower limit of a number."""
    least_allowed: bool = True
    choices: tuple[str | int, ...] = ()
    """The allowed values, if they can be listed."""

    def accepts(self, value: str | float) -> bool:
        """Return whether a value is within the range, and among the choices."""
        if self.least is not None and not isinstance(value, str):
            above = value >= self.least if self.least_allowed else value > self.least
            if not above:
                return False
        return not self.choices or value in self.choices


Keys: TypeAlias = Mapping[str, Key]
Entries: TypeAlias = Mapping[str, Entry]

THICKNESS_KEYS = {
    "thickness_mm": Key("thickness", 1e-3, "mm"),
    "thickness_um": Key("thickness", 1e-6, "um"),
    "thickness_m": Key("thickness", 1.0, "m"),
}
DENSITY_KEYS = {"density_kg_m3": Key("density", 1.0, "kg/m3")}
Z_KEYS = {"z_MRayl": Key("z", 1e6, "MRayl"), "z_Rayl": Key("z", 1.0, "Rayl")}
ELASTIC_KEYS = (
    THICKNESS_KEYS
    | DENSITY_KEYS
    | Z_KEYS
    | {"c_m_s": Key("c", 1.0, "m/s"), "q": Key("q", 1.0), "poisson": Key("poisson", 1.0)}
)
PIEZO_KEYS = (
    THICKNESS_KEYS
    | DENSITY_KEYS
    | {"h33_1e8_V_m": Key("h33", 1e8, "1e8 V/m"), "h33_V_m": Key("h33", 1.0, "V/m")}
    | {f"{n}_r": Key(n, EPS0, "eps0") for n in ("eps33S", "eps33T", "eps33P")}
    | {f"{n}_F_m": Key(n, 1.0, "F/m") for n in ("eps33S", "eps33T", "eps33P")}
    | {f"{n}_1e10_Pa": Key(n, 1e10, "1e10 Pa") for n in ("c33D", "c11p")}
    | {f"{n}_GPa": Key(n, 1e9, "GPa") for n in ("c33D", "c11p")}
    | {f"{n}_Pa": Key(n, 1.0, "Pa") for n in ("c33D", "c11p")}
    | {f"{n}_1e-12_m2_N": Key(n, 1e-12, "1e-12 m2/N") for n in ("s11E", "s12E")}
    | {f"{n}_m2_N": Key(n, 1.0, "m2/N") for n in ("s11E", "s12E")}
    | {"d31_pC_N": Key("d31", 1e-12, "pC/N"), "d31_C_N": Key("d31", 1.0, "C/N")}
    | {"sigma_p": Key("sigma_p", 1.0), "kp": Key("kp", 1.0)}
)
"""Each key ends in its unit; its value is the constant's name and the factor to SI units."""
ELECTRODE_KEYS = {"electrode_diameter_mm": Key("electrode_diameter", 1e-3, "mm")}
"""Diameter of both electrodes if they end before the rim; a property of the disk, not of a material."""
LAYER_SIZE_KEYS = {"diameter_mm": Key("layer_diameter", 1e-3, "mm")}
"""Diameter of an elastic layer if it ends before the rim of the disk."""
HOLE_KEYS = {"hole_diameter_mm": Key("hole_diameter", 1e-3, "mm")}
"""Diameter of a hole, beside the diameter."""
SIZE_KEYS = {"diameter_mm": Key("diameter", 1e-3, "mm"), "area_mm2": Key("area", 1e-6, "mm2")}
MASS_KEYS = {"mass_g": Key("mass", 1e-3, "g")}
BOLT_KEYS = {"stiffness_N_m": Key("stiffness", 1.0, "N/m"), "stiffness_kN_mm": Key("stiffness", 1e6, "kN/mm")}
DERIVED_KEYS = {
    "kt": Key("kt", 1.0),
    "Qm": Key("Qm", 1.0),
    "tan_delta": Key("tan_delta", 1.0),
    "v33D_m_s": Key("v33D", 1.0, "m/s"),
    "z33D_MRayl": Key("z33D", 1e6, "MRayl"),
    "fp_MHz": Key("fp", 1e6, "MHz"),
    "fp_Hz": Key("fp", 1.0, "Hz"),
    "c33_GPa": Key("c33", 1e9, "GPa"),
    "delay_ns": Key("delay", 1e-9, "ns"),
}
"""Constants that follow from fitted ones and can have limits."""
LIMIT_KEYS = PIEZO_KEYS | ELASTIC_KEYS | DERIVED_KEYS
"""The keys of a layer's table in [limits]."""
FREQUENCY_UNITS = {"MHz": 1e6, "kHz": 1e3, "Hz": 1.0}

MEANINGS = {
    "thickness": "thickness of the layer",
    "density": "density; of an elastic layer in place of z, as z = density * c",
    "z": "specific acoustic impedance, density * c",
    "c": "speed of longitudinal waves",
    "q": "mechanical quality factor",
    "poisson": "Poisson's ratio of an elastic layer, for `stack2d`",
    "c33D": "stiffness in thickness direction at constant electric displacement, c' (1 + j/Q)",
    "c11p": "planar stiffness of a thin disk",
    "h33": "piezoelectric constant h of the thickness mode",
    "eps33S": "clamped permittivity, eps' (1 - j tan d)",
    "eps33T": "free permittivity",
    "eps33P": "permittivity of a disk that is clamped in its plane",
    "s11E": "compliance in the plane at constant field",
    "s12E": "transverse compliance in the plane at constant field",
    "d31": "transverse piezoelectric charge constant",
    "sigma_p": "planar Poisson ratio, -s12E / s11E",
    "kp": "planar coupling factor",
    "electrode_diameter": "diameter of both electrodes if they end before the rim",
    "layer_diameter": "diameter of the layer if it ends before the rim, for `stack2d`",
    "diameter": "diameter of the faces",
    "hole_diameter": "diameter of a round hole through the middle of all layers, beside diameter_mm: a ring",
    "area": "area of the faces, for a transducer that is not round",
    "mass": "mass of all layers of the step as weighed: a datum of every fit; its u is required",
    "stiffness": "force per elongation of the bolt between its ends, E * area / length",
    "kt": "thickness coupling factor",
    "Qm": "quality factor of c33D",
    "tan_delta": "loss tangent of eps33S",
    "v33D": "speed of the thickness wave at constant electric displacement",
    "z33D": "impedance of the thickness wave at constant electric displacement",
    "fp": "antiresonance of the free layer in thickness direction",
    "c33": "stiffness of an elastic layer, z * c",
    "delay": "travel time through an elastic layer",
}
"""Meaning of each constant that a file can give."""

BELOW = {"poisson": 0.5}
"""Upper limits of constants, not included."""
_SIZES = {"thickness", "diameter", "hole_diameter", "area", "electrode_diameter", "layer_diameter"}
REAL = _SIZES | {"density", "z", "c", "q", "poisson", "mass", "stiffness"}
TIED = {"thickness", "z", "c", "q"}
"""Constants that can be tied with `{ same_as = "LAYER" }`, as two layers of a transducer can share them."""
POSITIVE = REAL | {"c33D", "eps33S", "eps33T", "eps33P", "s11E", "c11p", "kp"}
LOSS_SIGN = {"c33D": 1, "c11p": 1, "eps33S": -1, "eps33T": -1, "eps33P": -1, "s11E": -1}
"""Sign of the imaginary part of a passive constant with exp(+jwt): lossy stiffness c (1 + j/Q), permittivity
eps (1 - j tan d). A value with the other sign was usually copied from a text that uses exp(-jwt)."""


TOP_ENTRIES = {
    "name": Entry(
        "text", "name of the transducer", needed=True, allowed="letters, digits, space and _ + - . inside, on one line"
    ),
    "layers": Entry("tables", "the layers from back to front", needed=True),
    "electrical": Entry("table", "wiring; needed with several piezoelectric layers"),
    "bolt": Entry("table", "a bolt that presses layers together"),
    "load": Entry("table", "what the outermost faces border on; without it, air"),
    "steps": Entry("tables", "the gluing steps in their order", needed=True),
    "sweep": Entry("table", "how to measure; a step is measured only with such a plan"),
    "sample": Entry("table", "limits of the sample; no sweep that exceeds them is measured"),
    "limits": Entry("table", "permitted range of constants, for the verdict"),
    "measurement": Entry("table", "what is noted at every measurement"),
    "effects": Entry("tables", "known effects of the sample, part of the model of its steps"),
}
LAYER_ENTRIES = {
    "name": Entry("text", "name of the layer", needed=True, allowed="letters, digits and _ + -"),
    "kind": Entry("text", "kind of the layer", needed=True, choices=tuple(NEEDED)),
    "material": Entry(
        "text",
        "material of the library or of materials.toml; gives all values that are left out",
        allowed="a name, or for a piezoelectric layer { same_as = ... }: the ceramic of that layer",
    ),
}
POLED_ENTRIES = {
    "polarity": Entry(
        "integer",
        "direction of poling",
        default=1,
        allowed="1 (poled towards the front) or -1 (towards the back)",
        choices=(1, -1),
    ),
}
"""Of a piezoelectric layer only."""
ELECTRICAL_ENTRIES = {
    "connection": Entry("text", "wiring of several piezoelectric layers", needed=True, choices=("series", "parallel")),
}
BOLT_ENTRIES = {
    "between": Entry(
        "texts",
        "the layers that hold its ends; all that lies between them is pressed",
        needed=True,
        allowed="two names, back to front",
    ),
}
LOAD_ENTRIES = {
    "back": Entry("text", "behind the first layer", default="air", allowed="a material, or { z_MRayl = ... }"),
    "front": Entry("text", "before the last layer", default="air", allowed="a material, or { z_MRayl = ... }"),
}
STEP_ENTRIES = {
    "name": Entry("text", "name of the step", needed=True, allowed="letters, digits and _ + -"),
    "layers": Entry(
        "texts", "names of the layers that are present", needed=True, allowed="all of the step before, in their order"
    ),
    "reground": Entry(
        "table", "new thickness of layers of the step before, which were ground: { NAME = { thickness_mm = ... } }"
    ),
}
SEGMENT_ENTRIES = {
    **{
        f"{end}_{unit}": Entry(
            "number",
            f"{'lowest' if end == 'start' else 'highest'} frequency; give it in one of the units",
            unit,
            allowed="a positive number",
            least=0,
            least_allowed=False,
        )
        for end in ("start", "stop")
        for unit in FREQUENCY_UNITS
    },
    "points": Entry(
        "integer", "number of points, both ends included", default=USUAL_POINTS, allowed="2 or more", least=2
    ),
    "spacing": Entry("text", "spacing of the points", default="linear", choices=("linear", "log")),
}
SWEEP_ENTRIES = {
    "segments": Entry("tables", "frequency segments; each is recorded as one sweep", needed=True),
    "oscillator_V": Entry(
        "number",
        "level of the test signal, rms",
        "V",
        SweepPlan.oscillator_V,
        allowed="a positive number",
        least=0,
        least_allowed=False,
    ),
    "oscillator_mA": Entry(
        "number",
        "level as a current, rms; in place of oscillator_V",
        "mA",
        allowed="a positive number",
        least=0,
        least_allowed=False,
    ),
    "bias_V": Entry("number", "DC bias; 0 leaves the bias source off", "V", SweepPlan.bias_V),
    "point_delay_s": Entry(
        "number",
        "delay before each point is measured",
        "s",
        SweepPlan.point_delay_s,
        allowed="0 s (none) or more",
        least=0,
    ),
    "sweep_delay_s": Entry(
        "number",
        "delay before each sweep",
        "s",
        SweepPlan.sweep_delay_s,
        allowed="0 s (none) or more",
        least=0,
    ),
    "bandwidth": Entry(
        "integer",
        "measuring bandwidth, from fast to precise",
        default=SweepPlan.bandwidth,
        allowed=f"{BANDWIDTHS[0]} (fast) to {BANDWIDTHS[-1]} (precise)",
        choices=BANDWIDTHS,
    ),
    "point_average": Entry(
        "integer",
        "number of readings averaged at each point",
        default=SweepPlan.point_average,
        allowed="1 (off) or more",
        least=1,
    ),
    "sweep_average": Entry(
        "integer",
        "number of sweeps averaged",
        default=SweepPlan.sweep_average,
        allowed="1 (off) or more",
        least=1,
    ),
    "direction": Entry("text", "direction of the sweep", default=SweepPlan.direction, choices=("up", "down")),
}
SAMPLE_ENTRIES = {
    "max_bias_V": Entry("number", "largest bias, of either sign", "V", allowed="0 V or more", least=0),
    "max_oscillator_V": Entry(
        "number",
        "largest test signal, rms; plans with a current level are then refused",
        "V",
        allowed="0 V or more",
        least=0,
    ),
}
LIMITS_ENTRIES = {
    "conformance": Entry(
        "number",
        "probability with which a value must keep (or violate) its limit",
        default=USUAL_CONFORMANCE,
        allowed="0.5 (no guard band) to below 1",
    )
}
"""Beside these, [limits] has one table per layer."""
LIMIT_ENTRIES = {
    "min": Entry("number", "smallest permitted real part, in the unit of the key"),
    "max": Entry("number", "largest permitted real part"),
    "min_im": Entry("number", "smallest permitted imaginary part"),
    "max_im": Entry("number", "largest permitted imaginary part"),
}
MEASUREMENT_ENTRIES = {
    **{name: Entry("text", f"{name} of the measurement") for name in TEXT_KEYS},
    **{name: Entry("number", "temperature of the sample", "Celsius") for name in NUMBER_KEYS},
}
"""Usual keys of [measurement]; any other key holds a text or a number."""
EFFECT_ENTRIES = {
    "effect": Entry("text", "name in the catalogue, or `learned`", needed=True),
    "where": Entry("text", "place, as `pzctl diagnose` writes it: `terminals`, `layer:disk` ...", needed=True),
    "steps": Entry("texts", "steps that have it", default="all that have its place"),
    "quantity": Entry("text", "what a learned law corrects"),
    "law": Entry("text", "name of a learned law"),
    "reference_Hz": Entry("number", "frequency to which a law's parameters refer", "Hz"),
}
MATERIAL_ENTRIES = {
    "name": Entry("text", "name of the material; that of a library material replaces it", needed=True),
    "kind": Entry("text", "kind of the material", needed=True, choices=get_args(materials.Kind)),
    "source": Entry("text", "where the values come from", default="materials.toml of this user"),
}
QUEUE_ENTRIES = {
    "name": Entry("text", "name of the queue, noted with each measurement; default: the file's name", allowed="a text"),
    "build": Entry("text", "build file of the entries that name none, beside this file"),
    "measure": Entry("tables", "what to measure, in this order", needed=True),
}
QUEUED_ENTRIES = {
    "sample": Entry("text", "name of the sample; default: that of the build"),
    "build": Entry("text", "build file, beside this file"),
    "step": Entry("text", "gluing step", needed=True),
    "wait": Entry("text", "time to wait before it starts", allowed="a number with s, min or h"),
    "ask": Entry("text", "what a person is to do before it starts; Enter continues"),
    "repeat": Entry("integer", "number of measurements", default=1, allowed="1 or more", least=1),
    "every": Entry("text", "with repeat: time from start to start", allowed="a number with s, min or h"),
    "sweep": Entry("table", "plan in place of the build's, with the keys of [sweep]"),
    "measurement": Entry("table", "notes on these measurements, with the keys of [measurement]"),
}


def material_keys(kind: str) -> dict[str, Key]:
    """Return the keys that give constants of a material of this kind."""
    keys = PIEZO_KEYS if kind == "piezo" else ELASTIC_KEYS
    return {key: what for key, what in keys.items() if what.name != "thickness"}
