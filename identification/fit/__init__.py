"""The posterior of the joint stiffnesses from load tests."""
