"""Monte Carlo campaigns: scenarios x runs x arms to tables, in chunks that survive an interruption."""
