"""Statistics from tables, and the paper's claims judged by them: no kernel calls, no figures."""
