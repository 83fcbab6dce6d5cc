"""Who else answers: exact solutions, an ordinary global-DAE ANCF solver, Exudyn, OpenSees and PyElastica."""
