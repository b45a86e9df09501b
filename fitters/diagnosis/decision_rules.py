"""Every number that decides in a diagnosis, with where it comes from."""

ODDS = 0.08
"""Prior odds of an effect of the catalogue at one place: of two dozen places, one or two have one in a laboratory."""
COARSENED = 0.2
"""Of the evidence that the best explanation lacks, the part that counts as one nat: fitted by log score on generated
recordings with effects taken out of the catalogue."""
NAMED = 0.5
"""Posterior probability from which an effect is named: it is then more likely there than not."""
CLASS = 0.9
"""Correlation of what two effects do, less what constants and errors imitate, from which they are look-alikes."""
CLASS_NATS = 3.0
"""Or: difference of ln evidence up to which a recording does not tell one from the other (odds of twenty)."""
SOFT, WORTH = 10.0, 3.0
"""Gain in ln likelihood from which an effect is fitted: where all that is left counts as noise, and beside errors (the
odds against an effect are about as much)."""
FITTED_FIRST, FITTED_LATER, POLISHED = 8, 4, 2
"""How many effects are fitted alone, and beside what is there; and how many are fitted to the end. A budget."""
UNFINISHED = 5
"""How many of the best are fitted on where they had not come to an end. A budget."""
NEAR = 12.0
"""ln of odds within which explanations are kept in sight: what is further off is below 1e-5."""
PARENTS = 3
"""How many of the best are grown by one more effect. A budget."""
SUBSTITUTES = 2
"""How many others are fitted in place of each effect of the best. A budget."""
RIVALS = 6
"""Explanations with another effect in place of a named one that are held against it. A budget."""
MOST = 4
"""Effects at once. A budget."""
INSTRUMENT = 8e-4
"""Error of the instrument, root mean square of ln Z, where nothing else is told."""
TOLERATED = 2.0
"""Standard deviations of a fixture's residual (`errors.scales.FIXTURE`) up to which an effect at the terminals is no
more than that, where the instrument shows errors: one fixture in twenty has more."""
LEFT = 1.5e-3
"""Root mean square of ln Z that the imperfections of a good device make, all together: weak lines, scatter of its
thickness, losses that change over the band. More of the model's own error than that has a cause."""
