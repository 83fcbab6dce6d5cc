"""Golden answers: what the solver answers to small scenes, read through the public face (`import anctmm`) alone.

A group is a function of a `Variation` that returns answers by name; `table.json` has the value of each and what it may
differ by, which is measured: `SAFETY` times the largest change of the answer when all lengths and moduli change by
1e-12 of themselves, when the scene is shifted, and when Newton's tolerance is ten times smaller; never less than
`FLOOR` of its scale. Works, and reactions of implicit steps, which equally good methods read in different ways, may
differ by a few times their change with half the step (explicit steps and equilibria have reactions to all digits).
Answers of runs with a tolerance may differ by ten tolerances. Not among the answers is what is known to be wrong.

`python -m tests.golden` prints all answers beside the stored ones, `--update` measures and stores them anew.
"""
