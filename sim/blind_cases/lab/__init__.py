"""The lab world: realistic devices, instruments and effects, none of which follows a formula exactly.

It shares with the other blind cases: waves by power series of slices (`..waves`), finite disks by Ritz (`..ritz`). It
shares no solver, no equivalent circuit and no code of an effect with the fitters' models. Only the laws of physics are
common to both: the constitutive equations of a linear piezoelectric plate (T = c S - h D, E = -h S + D/eps), Hooke's
and Newton's laws in a passive layer, Kirchhoff's laws between analyzer and device, and 1/Q ~ f^n for losses. Where the
catalogue and this world describe an effect by the same law in some limit (a lead without skin effect is an inductance
in both), the drawn shapes keep away from that limit. Time convention exp(+jwt), SI.
"""
