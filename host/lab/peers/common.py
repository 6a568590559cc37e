"""What every peer's script shares: the job, the clock and the lines that it prints.

A job is a JSON file in the current folder: two OBJ meshes in mm, poses of the moving one in the fixed one's frame, and the limits of the clock. A
script prints one JSON object a line, `{"method": …}` before the answers of a method, `{"answer": …}` for each pose, `{"skipped": …}` where a method
cannot be had.
Distances are in mm, so that no absolute tolerance of a peer made for metres acts on micrometres.
"""

import json
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# Whether the parts overlap, and the signed distance in mm where the peer gives one.
Answer = tuple[bool, float | None]


@dataclass(frozen=True)
class Pose:
    """Pose of the moving part in the fixed part's frame."""

    position: np.ndarray  # mm
    quaternion: np.ndarray  # w, x, y, z

    def matrix(self) -> np.ndarray:
        """Rotation matrix."""
        w, x, y, z = self.quaternion
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )


@dataclass(frozen=True)
class Mesh:
    """Triangle mesh in mm."""

    path: Path
    vertices: np.ndarray  # n × 3
    triangles: np.ndarray  # m × 3, counter-clockwise from outside


# Places the moving part, which is not timed, and returns the query, which is.
Place = Callable[[Pose], Callable[[], Answer]]


@dataclass(frozen=True)
class Job:
    """What is asked of a peer."""

    fixed: Mesh
    moving: Mesh
    poses: list[Pose]
    repeats: int  # of a query; the shortest time counts
    longest_s: float  # on one pose; then no further repeat
    farthest_mm: float  # beyond every distance of the job


def read_job(path: str) -> Job:
    """Reads the job and sets the process's own limit of time."""
    job = json.loads(Path(path).read_text())
    # The default action of the signal ends the process even inside a peer's own code.
    signal.alarm(job["limit_s"])
    poses = [Pose(np.array(row[:3], float), np.array(row[3:], float)) for row in job["poses"]]
    return Job(read_obj(job["fixed"]), read_obj(job["moving"]), poses, job["repeats"], job["longest_s"], job["farthest_mm"])


def read_obj(name: str) -> Mesh:
    """Reads an OBJ file of vertices and triangles alone."""
    path = Path(name).resolve()
    lines = [line.split() for line in path.read_text().splitlines()]
    vertices = [[float(x) for x in words[1:]] for words in lines if words[0] == "v"]
    triangles = [[int(x) - 1 for x in words[1:]] for words in lines if words[0] == "f"]
    return Mesh(path, np.array(vertices), np.array(triangles))


def say(what: str, **fields: object) -> None:
    """Prints one JSON object as a line."""
    print(json.dumps({what: fields}), flush=True)


def shortest(query: Callable[[], Answer], job: Job) -> tuple[Answer, float]:
    """The answer, and the shortest time of it in µs."""
    begin, least = time.perf_counter(), float("inf")
    for repeat in range(job.repeats):
        start = time.perf_counter()
        answer = query()
        end = time.perf_counter()
        least = min(least, end - start)
        # Two at least, as one may be interrupted, unless one alone is ten times too long.
        if end - begin > (job.longest_s if repeat > 0 else 10 * job.longest_s):
            break
    return answer, 1e6 * least


def report(job: Job, method: str, kind: str, version: str, parts: Callable[[], Place], balls: Callable[[], Place]) -> None:
    """Asks every pose. `balls` gives the same call on two balls of radius 1 mm, whose time is the least that the call through Python can take."""
    try:
        touching = Pose(np.array([3.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
        # Both are held while asked: a query may refer to what its scene owns.
        two_balls, place = balls(), parts()
        _, floor_us = shortest(two_balls(touching), job)
        say("method", method=method, kind=kind, version=version, floor_us=floor_us)
        for index, pose in enumerate(job.poses):
            (overlaps, mm), us = shortest(place(pose), job)
            say("answer", method=method, pose=index, overlaps=bool(overlaps), mm=None if mm is None else float(mm), us=us)
    except Exception as error:  # noqa: BLE001: a peer that refuses a part is a result, said in its own words
        say("skipped", method=method, reason=f"{type(error).__name__}: {error}".splitlines()[0])


JOB = read_job(sys.argv[1])
