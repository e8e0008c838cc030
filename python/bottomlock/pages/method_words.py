"""What each aiding method does with the beams, in a line."""

METHOD_WORDS = {
    "ins": "no beam: the inertial system alone",
    "lc": "all four beams, none lost, by least squares: the reference",
    "tc": "a row for every valid beam",
    "vb": "a virtual beam from the filter's own velocity, taken as independent",
    "nsv": "sway is zero, sharply",
    "plcf": "only the components that the beams determine",
    "vhv": "heave from the filter, to get sway",
    "elc": "per component the least variance of vb, nsv, plcf and vhv",
    "vb_exact": "vb with its correlation kept",
    "info": "the observable principal axes through a velocity port",
    "weak_sway": "sway is zero, weakly",
    "sway_current": "sway in proportion to the yaw rate, relative to water whose current is estimated",
    "consistent": "the most informative of tc, weak_sway and sway_current that the beams do not contradict",
}
"""What each method does with the beams; a method that is not named here is shown without words."""
