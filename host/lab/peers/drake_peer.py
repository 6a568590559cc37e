"""Drake: signed distance of convex hulls (GJK with EPA of FCL, libccd). A `Mesh` is replaced by its hull too, so hulls are all there is."""

from importlib.metadata import version

from common import JOB, Answer, Place, Pose, report
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    Convex,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform


def place(fixed: Shape, moving: Shape) -> Place:
    scene = SceneGraph()
    source = scene.RegisterSource("peer")
    frame = scene.RegisterFrame(source, GeometryFrame("moving"))
    identity = RigidTransform()
    a = scene.RegisterAnchoredGeometry(source, GeometryInstance(identity, fixed, "fixed"))
    b = scene.RegisterGeometry(source, frame, GeometryInstance(identity, moving, "moving"))
    for geometry in (a, b):
        scene.AssignRole(source, geometry, ProximityProperties())
    context = scene.CreateDefaultContext()

    def at(pose: Pose):
        poses = FramePoseVector()
        unit = pose.quaternion / sum(pose.quaternion**2) ** 0.5
        poses.set_value(frame, RigidTransform(Quaternion(unit), pose.position))
        scene.get_source_pose_port(source).FixValue(context, poses)
        ask = scene.get_query_output_port().Eval(context)

        def query() -> Answer:
            distance = ask.ComputeSignedDistancePairClosestPoints(a, b).distance
            return distance < 0, distance

        return query

    return at


def parts() -> Place:
    return place(Convex(str(JOB.fixed.path), 1.0), Convex(str(JOB.moving.path), 1.0))


report(JOB, "Drake, hulls", "hulls", version("drake"), parts, lambda: place(Sphere(1.0), Sphere(1.0)))
