"""Names of columns that several kinds of table share (docs/formats.md, docs/glossary.md)."""

JOINTS = tuple(f"q{i}_deg" for i in range(1, 7))
FORCES = ("fx_n", "fy_n", "fz_n")
MASS = "mass_kg"
MOMENTS = ("mx_nm", "my_nm", "mz_nm")
DEFLECTIONS = ("dx_um", "dy_um", "dz_um")
SIGMAS = ("sx_um", "sy_um", "sz_um")
