"""The IRB 6660 as rigid bodies for MuJoCo: closed parallel rod, masses, and a joint wherever a cell can yield.

Drawn from the robot's zero pose (data-sheet lengths, as `arm.py`), every body frame parallel to the base frame there. Gear 3
turns a crank at the shoulder; a rod as long as the lower arm joins the crank's end to a lever behind the elbow. MuJoCo knows
the tree (the rod hangs on the crank); `statics.py` closes the loop.

Besides the six drives and the loop's three passive joints the tree holds every motion that an effect may need: base, bearings
across their axes, bending of lower arm and forearm, the force sensor, the tool in its spindle, the rod's length. Each of
them is rigid until an effect gives it a compliance.

All masses are made up for tests (the data sheet gives 1730 kg for the whole robot, not its parts).
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

HEIGHT, SHOULDER, LOWER_ARM, ELBOW, FOREARM, FLANGE = 0.8145, 0.3, 0.7, 0.28, 0.893, 0.2    # [m], data sheet
LEVER = 0.3         # [m] crank and lever of the parallel rod; made up for tests
LINKAGE = ("elbow", "rod_pitch", "rod_yaw")     # passive joints of the loop
DRIVES = tuple(f"drive{i}" for i in range(1, 7))
# base_from_flange at zero: flange z forward, flange x down (ABB's tool0).
ZERO_FLANGE = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])

# [kg] and [m] in the body's frame at zero; made up for tests.
COLUMN, LOWER, UPPER = (500.0, (0.1, 0, -0.3)), (230.0, (0.02, 0, 0.32)), (320.0, (0.1, 0, 0.18))
WRIST, HAND, DISC, ROD = (70.0, (-0.15, 0, 0)), (50.0, (0.03, 0, 0)), (15.0, (-0.03, 0, 0)), (30.0, (0, 0, LOWER_ARM / 2))


@dataclass(frozen=True)
class Tool:
    """TCP and centre of mass (3,) [m] in the flange frame, axes parallel to the flange's; mass [kg]."""

    tcp: tuple[float, float, float] = (0.12, 0.0, 0.25)
    centre: tuple[float, float, float] = (0.0, 0.0, 0.12)
    mass: float = 80.0


def _inertial(mass: float, centre: tuple[float, ...] | np.ndarray = (0, 0, 0)) -> str:
    x, y, z = centre
    return f'<inertial mass="{mass}" pos="{x} {y} {z}" diaginertia="1 1 1"/>'


def _joints(*joints: tuple[str, str, str]) -> str:
    axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1", "-z": "0 0 -1"}
    return "".join(f'<joint name="{name}" type="{kind}" axis="{axes[axis]}"/>' for name, kind, axis in joints)


def mjcf(tool: Tool, rigid: bool = False, extra: str = "", gravity: bool = True) -> str:
    """The model as MJCF. rigid: only drives and linkage, without the joints for effects; extra: further MJCF sections."""
    tcp, centre = ZERO_FLANGE @ tool.tcp, ZERO_FLANGE @ tool.centre
    light = '<inertial mass="1e-9" pos="0 0 0" diaginertia="1e-9 1e-9 1e-9"/>'      # a joint's intermediate body

    def yields(*joints: tuple[str, str, str]) -> str:
        return "" if rigid else _joints(*joints)

    return f"""<mujoco><compiler angle="radian"/><option gravity="0 0 {-9.80665 if gravity else 0}"/>{extra}<worldbody>
<body name="base">{_inertial(300, (0, 0, 0.3))}
 {yields(("base_x", "slide", "x"), ("base_y", "slide", "y"), ("rock_x", "hinge", "x"), ("rock_y", "hinge", "y"))}
 <body name="column" pos="0 0 {HEIGHT}">{_inertial(*COLUMN)}
  {_joints(("drive1", "hinge", "z"))}{yields(("tilt1_x", "hinge", "x"), ("tilt1_y", "hinge", "y"))}
  <body name="crank" pos="{SHOULDER} 0 0">{_inertial(20)}{_joints(("drive3", "hinge", "y"))}
   <body name="rod" pos="{-LEVER} 0 0">{_inertial(*ROD)}
    {_joints(("rod_pitch", "hinge", "y"), ("rod_yaw", "hinge", "x"))}{yields(("rod_length", "slide", "z"))}
    <site name="rod_end" pos="0 0 {LOWER_ARM}"/>
   </body>
  </body>
  <body name="lower_arm" pos="{SHOULDER} 0 0">{_inertial(*LOWER)}
   {_joints(("drive2", "hinge", "y"))}{yields(("tilt2_x", "hinge", "x"), ("tilt2_z", "hinge", "z"))}
   <body name="lower_end" pos="0 0 {LOWER_ARM}">{light}
    {yields(("bend2_x", "slide", "x"), ("bend2_y", "slide", "y"), ("slope2_y", "hinge", "y"), ("slope2_x", "hinge", "x"))}
    <body name="forearm">{_inertial(*UPPER)}
     {_joints(("elbow", "hinge", "y"))}{yields(("tilt3_x", "hinge", "x"), ("tilt3_z", "hinge", "z"))}
     <site name="lever" pos="{-LEVER} 0 0"/>
     <body name="forearm_end" pos="{FOREARM} 0 {ELBOW}">{light}
      {yields(("bend3_y", "slide", "y"), ("bend3_z", "slide", "z"), ("slope3_y", "hinge", "y"), ("slope3_z", "hinge", "z"))}
      <body name="wrist">{_inertial(*WRIST)}{_joints(("drive4", "hinge", "x"))}{yields(("tilt4_z", "hinge", "z"))}
       <body name="hand">{_inertial(*HAND)}
        {_joints(("drive5", "hinge", "y"))}{yields(("tilt5_x", "hinge", "x"), ("tilt5_z", "hinge", "z"))}
        <body name="disc" pos="{FLANGE} 0 0">{_inertial(*DISC)}{_joints(("drive6", "hinge", "x"))}
         <body name="spindle">{_inertial(tool.mass, centre)}
          {yields(("sensor_x", "hinge", "-z"), ("sensor_y", "hinge", "y"))}
          <body name="tool" pos="{tcp[0]} {tcp[1]} {tcp[2]}">{light}
           {yields(("tool_x", "slide", "-z"), ("tool_y", "slide", "y"))}
           <site name="tcp"/>
          </body>
         </body>
        </body>
       </body>
      </body>
     </body>
    </body>
   </body>
  </body>
 </body>
</body>
</worldbody></mujoco>"""


def compile_model(tool: Tool, rigid: bool = False, extra: str = "", gravity: bool = True) -> mujoco.MjModel:
    """The compiled model; arguments as `mjcf`."""
    return mujoco.MjModel.from_xml_string(mjcf(tool, rigid, extra, gravity))


def placed(q: np.ndarray) -> dict[str, float]:
    """Positions of drives and linkage [rad] with the rigid unloaded arm at the controller's angles q (6,) [rad]."""
    return dict(zip(DRIVES, q, strict=True)) | {"elbow": q[2] - q[1], "rod_pitch": q[1] - q[2], "rod_yaw": 0.0}


def robot_links() -> list[tuple[float, np.ndarray]]:
    """Mass [kg] and centre of mass (3,) [m] of the six links in their modified-DH frames, as robot.yaml wants them.

    The rod is shared out between lower arm and forearm so that the gravity torques at the drives are exactly the closed
    loop's: its mass stands at the lever behind the elbow, and the lower arm's centre moves down by what that is too much.
    """
    frames = {      # columns: x, y, z of the modified-DH frame at zero, in base axes
        1: np.eye(3),
        2: np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
        3: np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
        4: np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]),
        5: np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
        6: ZERO_FLANGE,
    }
    rod = ROD[0]
    lower = np.array(LOWER[1]) - [0, 0, rod / LOWER[0] * (LOWER_ARM - ROD[1][2])]
    forearm = (UPPER[0] * np.array(UPPER[1]) + rod * np.array([-LEVER, 0, 0])) / (UPPER[0] + rod)
    links = [(COLUMN[0], COLUMN[1]), (LOWER[0], lower), (UPPER[0] + rod, forearm), WRIST, HAND, DISC]
    return [(mass, frames[i].T @ np.array(centre)) for i, (mass, centre) in enumerate(links, 1)]
