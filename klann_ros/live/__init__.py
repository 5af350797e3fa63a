"""The live page without ROS: who may do what, what is said to it, what it draws, its server."""
