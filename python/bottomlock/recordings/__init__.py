"""What every reader of a recording shares: its streams in SI, axes, and the closure of its beams."""
