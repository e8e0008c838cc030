"""One look for every figure: palette, labels, curves, files."""
