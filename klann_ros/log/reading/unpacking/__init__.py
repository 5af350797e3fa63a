"""What rosbag2 packs: whole files, single messages."""
