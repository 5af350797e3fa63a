"""SQLite files of rosbag2 (.db3) of any age."""
