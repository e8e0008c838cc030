"""The claims of Tal, Klein & Katz 2017, and the verdict on each from a campaign."""
