"""What every room uses and no robot is needed for: findings, files, tables, reports."""
