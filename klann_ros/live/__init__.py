"""The live page without ROS: access rules, protocol, drawn state and server."""
