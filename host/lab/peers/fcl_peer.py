"""FCL by python-fcl: trees of boxes over triangles, and GJK with EPA (libccd) on convex hulls.

`distance` of two meshes answers 0 where they overlap; the depth is then the largest over the pairs of triangles that `collide` finds, and both calls
are timed.
"""

from importlib.metadata import version

import fcl
import numpy as np
from common import JOB, Answer, Mesh, Place, Pose, report
from scipy.spatial import ConvexHull

# More than the pairs of triangles that cross in any pose.
MOST_CONTACTS = 100_000


def tree(mesh: Mesh) -> fcl.BVHModel:
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.triangles))
    model.addSubModel(mesh.vertices, mesh.triangles)
    model.endModel()
    return model


def hull(mesh: Mesh) -> fcl.Convex:
    found = ConvexHull(mesh.vertices)
    index = {vertex: place for place, vertex in enumerate(found.vertices)}
    faces: list[int] = []
    for triangle, plane in zip(found.simplices, found.equations):
        a, b, c = mesh.vertices[triangle]
        outward = np.dot(np.cross(b - a, c - a), plane[:3]) > 0
        faces += [3, *(index[vertex] for vertex in (triangle if outward else triangle[::-1]))]
    return fcl.Convex(mesh.vertices[found.vertices], len(found.simplices), np.array(faces))


def place(fixed: fcl.CollisionGeometry, moving: fcl.CollisionGeometry, signed: bool) -> Place:
    here = fcl.CollisionObject(fixed, fcl.Transform())
    request = fcl.DistanceRequest(enable_signed_distance=signed)
    contacts = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=True)

    def at(pose: Pose):
        there = fcl.CollisionObject(moving, fcl.Transform(pose.quaternion, pose.position))

        def query() -> Answer:
            distance = fcl.distance(here, there, request, fcl.DistanceResult())
            if distance > 0 or signed:
                return distance <= 0, distance
            found = fcl.CollisionResult()
            fcl.collide(here, there, contacts, found)
            depths = [contact.penetration_depth for contact in found.contacts]
            return True, -max(depths) if depths else None

        return query

    return at


def balls(signed: bool) -> Place:
    return place(fcl.Sphere(1.0), fcl.Sphere(1.0), signed)


VERSION = version("python-fcl")
report(JOB, "FCL, triangles", "triangles", VERSION, lambda: place(tree(JOB.fixed), tree(JOB.moving), False), lambda: balls(False))
report(JOB, "FCL, hulls", "hulls", VERSION, lambda: place(hull(JOB.fixed), hull(JOB.moving), True), lambda: balls(True))
