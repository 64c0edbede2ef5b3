"""A program as the robot drives it: poses, joint angles, the way between the targets, the feed."""
