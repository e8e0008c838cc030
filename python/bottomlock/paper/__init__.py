"""What Tal, Klein & Katz 2017 claim, and the verdict on each claim from a campaign."""
