"""The limits of the decision, each with its reason."""

from __future__ import annotations

# Largest shares of the undescribed part and of the analyser's error that a named effect may leave. With odds above e^60 the first is not required;
# with smaller odds the second is not sufficient: the cause may be outside the catalogue's ranges, such as leads that differ between the sweeps.
HALF, RELIEF = 0.5, 0.6
CLEAR_GAIN = 60.0
# A further effect that only reduces the analyser's error is named if that error is larger than this without it, in standard deviations, of which
# three are the specification. With the only hidden effect it was 4.3 and 4.6, with one of two hidden ones 7 or more (independent generator).
FURTHER_RELIEF_SIGMA = 6.0
# Log odds that suffice for an effect that describes everything with usual values. In 45 sets of sweeps of motors without a hidden effect, outside
# the protocol (seed 881177), a wrong effect gained at most 6, and one in place of a capacitance that drifted 21.
ENOUGH_GAIN = 25.0
# Share of the undescribed part that an approximate law may leave: winding sections leave 4 and 10 % of it where a winding's sections are unlike.
NEARLY_ALL = 0.1
# The same of two effects: a law that leaves no more is as accurate as laws of real materials can be expected to be.
NEXT_TO_ALL = 0.02
# The same of two effects whatever the specification of an impedance analyser, if nothing else is accepted. In three independent generators the pair
# of five motors was found, left 1/186 to 1/111 of the undescribed part and was not named, since the analyser would have had to err beyond its
# specification; two of them need unusual values and stay unnamed. Of eleven motors with a cause outside the catalogue no set left less than 1/34.
HARDLY_ANYTHING = 0.01
# So many laws of which each describes what one effect leaves show only that its own law is approximate. Beside the cage of a steel sleeve there
# were four; beside a supply cable, where a loss and a relaxation of the insulation were hidden too, one.
SEVERAL_LAWS = 3
# Circuits whose errors differ by less than this factor are about equally good.
ALIKE = 2.0
# The same of circuits that may change places because one effect is commoner: half as far apart, in logarithms, as those of a family.
NEARLY_ALIKE = ALIKE**0.5
# Models so near the best in log score may be the best in another local minimum: a rotor cage gained 9, and a shorted turn 8, along a valley.
CONTENDING = 20.0
# Log odds of 20 to 1: with less, two effects are not distinguished.
SURE_GAIN = 3.0
# `BEYOND_SIGMA` of a network analyser: four times the specification, the largest errors that the prior of a named analyser allows. Three pairs of
# effects that needed larger ones (20, 22 and 100 standard deviations; two independent generators and a hard board) were all wrong.
BEYOND_SIGMA_OF_NETWORK = 12.0
# Number of error bars beyond which an element's value contradicts them: one in 370 by chance, and one of seven elements in 53.
MOVED_SIGMA = 3.0
