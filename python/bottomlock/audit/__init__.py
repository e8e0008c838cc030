"""Audit of a recorded log: geometry, closure, defects and mounting of the DVL, as ranked findings.

`logs` reads; `robust`, `matrix`, `closure`, `beam_order`, `beams`, `depth`, `water` and `mounting` estimate; `context`
holds a log with its estimates; `defects` and `beside` check, `checks` has the list of all; `findings` has a template a
kind; `run` runs all, `page` and `geometry_file` write the result.
"""
