"""The deviation predicted, the commanded poses that undo it, and the files of one job."""
