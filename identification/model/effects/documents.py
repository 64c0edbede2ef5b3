"""Documents that several effects take their laws and sizes from. "The paper" is that of docs/paper.md."""

HARMONIC_DRIVE = "Harmonic Drive LLC, CSF & CSG catalogue, Torsional Stiffness"
KR300 = "the KUKA KR300's file that docs/real-data.md names"
NABTESCO = "Nabtesco, FAQ Backlash (nabtesco.de/en/faq/backlash)"
WERNHOLT = ("E. Wernholt, S. Gunnarsson, Nonlinear Identification of a Physically Parameterized Robot Model, IFAC Symposium on "
            "System Identification, 2006")
