"""The lab world: devices, instruments and effects as a laboratory has them, none of which follows a formula exactly.

Shared with the world around it: waves by power series of slices (`..waves`), finite disks by Ritz (`..ritz`). Not
shared with the models of the fitters: any solver, any equivalent circuit, any code of an effect. What *is* the same,
because there is one nature only: the constitutive equations of a linear piezoelectric plate (T = c S - h D, E = -h S
+ D/eps), Hooke's and Newton's laws in a passive layer, Kirchhoff's for what lies between analyzer and device, and 1/Q
~ f^n for losses. Where the catalogue and this world describe one effect by the same law in some limit (a lead without
skin effect is an inductance in both), the drawn shapes keep away from that limit. Time convention exp(+jwt), SI.
"""
