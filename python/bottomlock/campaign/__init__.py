"""Monte Carlo campaigns: scenarios x runs x methods to tables, in chunks that survive an interruption."""
