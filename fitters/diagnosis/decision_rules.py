"""Every threshold of a diagnosis, with its origin."""

ODDS = 0.08
"""Prior odds of a catalogue effect at one place: a laboratory sample has one or two effects at two dozen places."""
APPROXIMATE = 16.0
"""Nats that count as one more where the recording has any error of instrument or model: there every likelihood is an
approximation. 0 for exact recordings. Fitted with `COARSENED` by log score on generated recordings, 59 complete
searches: from here on the score is within 4 % of its best, and larger values only name less. By the score of all
effects, named or not, of 41 other searches: 69.7 nats at 0, 49.7 at 8, 48.3 at 16, 47.7 at 24; of 27 with fits that
arrive: 68.4, 67.9, 69.4 and 71.1, with 4, 0, 0 and 0 wrong names for sure and 23, 21, 21 and 20 right ones
(tests/benchmarks/test_coarsening.py)."""
COARSENED = 0.05
"""Share of the best explanation's missing ln evidence that is added to the coarsening factor (see
`hypothesis.coarseness`)."""
COARSENED_RIM = 0.5
"""The same for a finite diameter and what is beside it: ten constants imitate much more than one effect does, so what
they leave unexplained counts ten times as much."""
UNFORESEEN = 0.15
"""Probability that what is in a recording with errors is not among the hypotheses that were compared: a formula is too
far off, the effect is in no catalogue, or no fit has reached the minimum. Counted on generated recordings: of 88
effects to which the hypotheses alone gave 0.9 or more, 12 were wrong (8 to 22 %). By the log score of all effects of 48
of these recordings 0.15 is 3 nats better than 0.1 and 5 worse than 0.25. 0 for exact recordings."""
UNLISTED = 0.5
"""Probability beforehand that what is in a recording is in no list, where its law is looked for (`learn`): whoever asks
for that expects it as likely as not."""
MISTAKEN = 0.24
"""Probability that an effect is named for sure in place of one that is in no list: counted in 10 of 42 recordings whose
effect was deleted from the catalogue (13 to 39 %; `tests/benchmarks/test_leave_one_out.py`)."""
SUREST = 1 - UNLISTED * MISTAKEN / (UNLISTED * MISTAKEN + 1 - UNLISTED)
"""Largest probability of a name then: that of what is in the list, given that it was named."""
NAMED = 0.5
"""Posterior probability from which an effect is named: it is then more likely present than absent."""
NOTHING = 0.05
"""Probability of no effect at all below which a recording shows something, even if no effect can be named: so often is
that a false alarm."""
TOLD = 0.01
"""Difference of probabilities that is none: they are told in hundredths."""
LISTED = 3
"""Number of effects that are listed where none can be named."""
CLASS = 0.9
"""Correlation of two effects, after projecting out constants and errors, from which they count as look-alikes."""
CLASS_NATS = 3.0
"""Difference of ln evidence within which a recording does not distinguish two explanations (odds of twenty)."""
SOFT, WORTH = 10.0, 3.0
"""Gain in ln likelihood from which an effect is fitted: when the whole residual counts as noise, and beside an error
model. The prior odds against an effect are about as much."""
FITTED_FIRST, FITTED_LATER, POLISHED = 16, 4, 2
"""Budget: effects fitted alone, effects fitted beside others, and hypotheses fitted to convergence."""
AHEAD = 4
"""Budget: fits of effects alone that are made before the others, so that what is hopeless beside them ends early."""
FITTED_ASTRAY = 6
"""Budget: further effects fitted beside the best hypothesis where even that leaves more than the usual errors. What is
missing has led its constants astray: what counts as noise then tells more than errors that may stand for anything."""
EXACT_FIRST, EXACT_LATER = 12, 8
"""Budget of the search without errors: effects fitted alone and beside others."""
EXACT_PARENTS = 2
"""Budget of the search without errors: hypotheses extended of each number of effects, while more than noise is left."""
ABSORBED = 0.1
"""Part of an effect's change that the constants leave, below which its gain says little: what decides is of second
order, and the effect is fitted whatever its gain."""
ASTRAY = 0.05
"""Probability that constants and dimensions of a right model are further from the build. Where they are, something
missing has probably moved them, and fits also begin where the build states them: all it costs is time."""
BUDGET = 2_000_000
"""Budget: steps of descents times points after which no more effects are sought, none is moved and none is replaced.
A disk with one effect takes a tenth of it, three steps with several effects all."""
UNFINISHED = 5
"""Budget: number of best hypotheses whose fits continue if they have not converged, and of continuations of one: a
probability is computed from how well it describes the recordings where it ended. As many tell what even the best of all
miss."""
NEAR = 12.0
"""ln odds within which a hypothesis is kept; anything further behind has a probability below 1e-5."""
LIKELY = 7.0
"""ln odds within which a fit may be continued with all points of dense recordings; anything further behind has a
probability below 1e-3, and no name depends on it."""
PARENTS = 3
"""Budget: number of best hypotheses that are extended by one more effect, and from which a conclusion is drawn."""
SUBSTITUTES = 3
"""Budget: substitutes fitted for each effect of the best hypothesis: as many that promise most, and look-alikes. Also
effects that explain most alone, fitted beside one that hides them."""
TRIED_ALONE = 2
"""Largest number of effects for which one that stands for all of them has been tried: every effect is, alone."""
RESEMBLING = 0.5
"""Correlation with an effect, after projecting out the constants, from which another is fitted in its place."""
RIVALS = 6
"""Budget: hypotheses with another effect in place of a named one that are compared with it."""
MOST = 4
"""Budget: largest number of effects at once."""
BEHIND_WIRES = 2
"""Budget: effects at the terminals that are fitted to a plate, one after the other, before a disk of finite diameter is
tried: a wire and its stray capacitance."""
SHARP = 20.0
"""Quality factor from which a resonance is a line, which stands out of smooth errors."""
LINES = 8
"""Budget: weak lines of one step that become part of the error model."""
SWITCHES = 3
"""Budget: switches of the analyzer's range that become part of the error model."""
HELD_READY = 6
"""Budget of memory: number of best hypotheses whose columns of errors are kept; those of others are made again."""
RECHECKED = 12
"""Budget: hypotheses fitted again when the error model has changed."""
TOLERATED = 2.0
"""Standard deviations of a fixture's residual (`prior_scales.FIXTURE`) up to which an effect at the terminals is
attributed to the fixture, if the recordings show instrument errors, and of the analyzer's accuracy up to which an
artefact is an error that it may have; one in twenty has more."""
FALSE_ALARM = 0.01
"""Probability below which held-out data contradict what was learned: so many right laws are said to be unproved. A law
is chosen because it describes the recording; only a prediction can prove it. 1 of 200 was in
`tests/benchmarks/test_forecasts.py`."""
