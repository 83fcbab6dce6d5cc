"""Who else answers: an ordinary global-DAE ANCF solver, Exudyn models and exact solutions."""
