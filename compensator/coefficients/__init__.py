"""A log of one program and its stock -> the force coefficients of tool and material, and where they do not fit another log."""
