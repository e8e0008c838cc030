"""Audit of a recorded log: geometry, closure, defects and mounting of the DVL, as ranked findings.

`logs` reads; `robust`, `matrix`, `closure` and `mounting` estimate; `context` holds a log with its estimates; `defects`
checks a log alone, `checks` has the list of all; `findings` has a template per kind; `run` runs all, `page` and
`geometry_file` write the result.
"""
