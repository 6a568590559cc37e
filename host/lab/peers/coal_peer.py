"""coal (formerly hpp-fcl): trees of boxes over triangles, and GJK with EPA on convex hulls.

`distance` of two meshes answers 0 where they overlap. The depths that `collide` gives for pairs of triangles are of the triangles, not of the solids
(−45 mm where 0.1 mm overlap), so a mesh has no depth here.
"""

import coal
from common import JOB, Answer, Mesh, Place, Pose, report


def tree(mesh: Mesh) -> coal.BVHModelOBBRSS:
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh.triangles), len(mesh.vertices))
    vertices, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in mesh.vertices:
        vertices.append(vertex)
    for a, b, c in mesh.triangles.tolist():
        triangles.append(coal.Triangle(a, b, c))
    model.addSubModel(vertices, triangles)
    model.endModel()
    return model


def hull(mesh: Mesh) -> coal.ConvexBase:
    model = tree(mesh)
    model.buildConvexHull(False, "")
    return model.convex


def place(fixed: coal.CollisionGeometry, moving: coal.CollisionGeometry, has_depth: bool) -> Place:
    identity, request = coal.Transform3s.Identity(), coal.DistanceRequest()

    def at(pose: Pose):
        there = coal.Transform3s(pose.matrix(), pose.position)

        def query() -> Answer:
            distance = coal.distance(fixed, identity, moving, there, request, coal.DistanceResult())
            return distance <= 0, distance if distance > 0 or has_depth else None

        return query

    return at


def balls(has_depth: bool) -> Place:
    return place(coal.Sphere(1.0), coal.Sphere(1.0), has_depth)


report(JOB, "coal, triangles", "triangles", coal.__version__, lambda: place(tree(JOB.fixed), tree(JOB.moving), False), lambda: balls(False))
report(JOB, "coal, hulls", "hulls", coal.__version__, lambda: place(hull(JOB.fixed), hull(JOB.moving), True), lambda: balls(True))
