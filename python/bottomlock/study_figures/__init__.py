"""The figures of a campaign: data frames in, matplotlib figures out; no statistics are computed here."""
