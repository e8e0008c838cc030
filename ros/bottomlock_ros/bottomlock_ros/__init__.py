"""bottomlock's live engine as a lifecycle node of ROS 2."""
