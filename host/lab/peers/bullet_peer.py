"""Bullet by pybullet: `getClosestPoints` of the fixed part's triangles against the moving part's hull, and of two hulls.

Triangles against triangles are not offered: the call answers nothing. Each shape has a margin of 0.001, in mm here, so gaps are 1 to 2 µm short.
"""

from importlib.metadata import version

import pybullet
from common import JOB, Answer, Mesh, Place, Pose, report


def shape(mesh: Mesh, flags: int) -> int:
    made = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(mesh.path), flags=flags)
    if made < 0:
        raise ValueError(f"{mesh.path.name} is refused")
    return made


def place(fixed: int, moving: int) -> Place:
    a, b = pybullet.createMultiBody(0, fixed), pybullet.createMultiBody(0, moving)

    def at(pose: Pose):
        w, x, y, z = pose.quaternion.tolist()
        pybullet.resetBasePositionAndOrientation(b, pose.position.tolist(), [x, y, z, w])

        def query() -> Answer:
            points = pybullet.getClosestPoints(a, b, JOB.farthest_mm)
            distance = min((point[8] for point in points), default=None)
            return distance is not None and distance < 0, distance

        return query

    return at


def parts(flags: int) -> Place:
    return place(shape(JOB.fixed, flags), shape(JOB.moving, 0))


def balls() -> Place:
    ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=1.0)
    return place(ball, ball)


pybullet.connect(pybullet.DIRECT)
VERSION = version("pybullet")
report(JOB, "Bullet, hulls", "hulls", VERSION, lambda: parts(0), balls)
report(JOB, "Bullet, triangles against a hull", "triangles", VERSION, lambda: parts(pybullet.GEOM_FORCE_CONCAVE_TRIMESH), balls)
