"""One line on each aiding method."""

METHOD_WORDS = {
    "ins": "nothing: the inertial system alone",
    "lc": "velocity by least squares from all four beams, none lost: the reference",
    "tc": "one row for every valid beam (tight coupling)",
    "vb": "a virtual beam from the filter's own velocity, assumed independent of it",
    "nsv": "assumes that sway is zero, with a small variance",
    "plcf": "uses only the platform components that the beams determine",
    "vhv": "takes heave from the filter to solve for sway",
    "elc": "for each component the least variance of vb, nsv, plcf and vhv",
    "vb_exact": "vb with its correlation to the filter kept",
    "info": "the observable principal axes through a velocity port",
    "weak_sway": "assumes that sway is zero, with a large variance",
    "sway_current": "tc, then sway and heave through the water, with the current as states",
    "consistent": "the most informative of tc, weak_sway and sway_current that the beams do not contradict",
    "dead_reckoning": "no filter: the DVL's velocity, or the last one, turned by the recorded attitude and summed up",
}
"""By method; a method that is not a key is shown without words."""
