"""Audit of a recorded log: geometry, closure, defects and mounting of the DVL, as ranked findings.

`logs` reads, `robust` fits, `matrix`, `closure`, `beam_order`, `defects`, `depth` and `mounting` estimate or test one
thing each, the `*_findings` modules turn results into findings, `run` runs all, `figures` and `page` show the result.
"""
