"""How large and how small the numbers of a file may be: far beyond anything measured, and such that their squares and quotients
are numbers too. What is beyond is a slip of the pen, and is refused where it stands."""

# Of a table's cell, whatever its unit: counters and times since 1970 in nanoseconds are below it.
LARGEST_CELL = 1e19
# Of cell.yaml and robot files, whatever the unit, and of what must be above zero there.
LARGEST, SMALLEST = 1e12, 1e-12
# A stiffness of a joint [N m/rad]: a rubber band and a rock.
SOFTEST, STIFFEST = 1e-3, 1e20
# Of such stiffnesses, and of anything else in a covariance.
LARGEST_VARIANCE = 1e60
# 1 sigma [m] of a reading on a part: no probe has less (engineering judgement: the best measuring machines state some tenths
# of a micrometre).
FINEST_READING = 6e-9
