"""Ports: an estimate as the bytes that another system takes, with an uncertainty that this system uses safely."""
