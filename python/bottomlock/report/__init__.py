"""The page of a finished campaign, and the advice drawn from it."""
