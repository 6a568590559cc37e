"""MuJoCo: `mj_geomDistance` of mesh geoms, which are their convex hulls, and of signed distance fields of the meshes (geoms of type `sdf`).

A field is asked by a descent from some starts (`sdf_initpoints`, `sdf_iterations`, here as delivered); where it finds no overlap it gives no gap.
"""

import mujoco
import numpy as np
from common import JOB, Answer, Place, Pose, report

XML = """<mujoco>
  <asset>{assets}</asset>
  <worldbody><geom {fixed}/><body name="moving" mocap="true"><geom {moving}/></body></worldbody>
</mujoco>"""
BALL = 'type="sphere" size="1"'


def place(assets: str, fixed: str, moving: str) -> Place:
    model = mujoco.MjModel.from_xml_string(XML.format(assets=assets, fixed=fixed, moving=moving))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    points = np.zeros(6)

    def at(pose: Pose):
        data.mocap_pos[0], data.mocap_quat[0] = pose.position, pose.quaternion
        mujoco.mj_kinematics(model, data)

        def query() -> Answer:
            distance = mujoco.mj_geomDistance(model, data, 0, 1, JOB.farthest_mm, points)
            return distance < 0, distance if distance < JOB.farthest_mm else None

        return query

    return at


def parts(kind: str) -> Place:
    assets = f'<mesh name="fixed" file="{JOB.fixed.path}"/><mesh name="moving" file="{JOB.moving.path}"/>'
    return place(assets, f'type="{kind}" mesh="fixed"', f'type="{kind}" mesh="moving"')


def balls() -> Place:
    return place("", BALL, BALL)


VERSION = mujoco.__version__
report(JOB, "MuJoCo, hulls", "hulls", VERSION, lambda: parts("mesh"), balls)
report(JOB, "MuJoCo, distance fields", "fields", VERSION, lambda: parts("sdf"), balls)
