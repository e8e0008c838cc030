"""True motions: the type, analytic trajectories with exact derivatives, short manoeuvres."""
