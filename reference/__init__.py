"""Independent solvers and solutions: exact, an ordinary global-DAE ANCF solver, Exudyn, OpenSees, PyElastica."""
