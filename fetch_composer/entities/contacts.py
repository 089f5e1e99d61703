"""Which geoms may touch: MuJoCo's contact bits, chosen so that the broad phase stays idle.

Two geoms collide if one's `contype` shares a bit with the other's `conaffinity`. The robot's bit
is set in fetch_arm.xml and fetch_gripper.xml.
"""

ROBOT = 1
PROP = 2

# What a prop (a block, a puck) is, and what it meets: the robot and other props.
PROP_CONTACT = {'contype': PROP, 'conaffinity': ROBOT | PROP}

# Static scenery meets the robot and props, never other scenery.
SCENERY_CONTACT = {'contype': 0, 'conaffinity': ROBOT | PROP}
