"""What pytest leaves alone here: a program of its own, which needs zenoh-ros2-sdk."""

collect_ignore = ["sdk_partner.py"]
