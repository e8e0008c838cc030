"""Statistics from tables: expressions over data frames, no kernel calls, no figures."""
