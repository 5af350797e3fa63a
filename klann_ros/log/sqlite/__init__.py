"""rosbag2's other storage: SQLite files, read without being believed, also torn ones."""
