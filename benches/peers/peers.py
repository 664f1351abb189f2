"""OpenCV and PoseLib through their PyPI wheels, for the program in src/.

Speaks with it through standard input and output, a line of JSON each way:

    peers.py                                  the program
    {"opencv": "5.0.0", "poselib": null}  ->  what is installed
                                          <-  the studies
    <name of a study>                     <-  solve all of its tasks once with every method that takes it
    ""                                    ->  done; and so on, round by round, the program solving its own in between
                                          <-  end of input
    {study: {method: {"poses": ..., "ns": ...}}}
                                          ->  last poses, and for each task the median time over the rounds

A call is timed from its arrays of float64 to its answer, with a clock before and behind it; nothing is subtracted.
"""

import json
import math
import statistics
import sys
from time import perf_counter_ns

try:
    import cv2
    import numpy as np

    # One core each, as the other program.
    cv2.setNumThreads(1)
except ImportError:
    cv2 = None
try:
    import numpy as np
    import poselib
except ImportError:
    poselib = None


# The gate of the peers' robust methods in deviations: of 2.5, 3, 3.7, 5 and 8 the one with which they do best here.
GATE = 5.0


class Task:
    """A trial as the calls take it."""

    def __init__(self, sent):
        self.points = np.array(sent["points_m"])
        self.pixels = np.array(sent["pixels_px"])
        self.gate_px = GATE * sent["sigma_px"]
        (fx, fy), (cx, cy) = sent["focal_px"], sent["principal_px"]
        self.k = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        self.four_points, self.four_pixels = self.points[:4].copy(), self.pixels[:4].copy()
        rotation, translation = np.array(sent["start_rotation"]), np.array(sent["start_translation_m"])
        if cv2:
            self.start = cv2.Rodrigues(rotation)[0], translation.reshape(3, 1)
        if poselib:
            self.camera = poselib.Camera("PINHOLE", [fx, fy, cx, cy], *sent["size_px"])
            self.pose = poselib.CameraPose()
            self.pose.R, self.pose.t = rotation, translation
            rays = np.column_stack([(self.pixels[:3] - [cx, cy]) / [fx, fy], np.ones(3)])
            self.bearings = rays / np.linalg.norm(rays, axis=1, keepdims=True)
            self.corners = self.points[:3].copy()


# OpenCV. Answers are (rvec, tvec) or None.


def opencv(flag):
    def solve(task):
        found, rvec, tvec = cv2.solvePnP(task.points, task.pixels, task.k, None, flags=flag)
        return (rvec, tvec) if found else None

    return solve


def opencv_four(task):
    """A minimal method takes four points here, and no more."""
    found, rvec, tvec = cv2.solvePnP(task.four_points, task.four_pixels, task.k, None, flags=cv2.SOLVEPNP_AP3P)
    return (rvec, tvec) if found else None


def opencv_squared_error(task, rvec, tvec):
    projected, _ = cv2.projectPoints(task.points, rvec, tvec, task.k, None)
    distance = projected[:, 0] - task.pixels
    return np.vdot(distance, distance)


def opencv_refined(flag):
    """Every solution refined, the one with the least error given."""

    def solve(task):
        _, rvecs, tvecs, _ = cv2.solvePnPGeneric(task.points, task.pixels, task.k, None, flags=flag)
        best, least = None, np.inf
        for start in zip(rvecs, tvecs):
            pose = cv2.solvePnPRefineLM(task.points, task.pixels, task.k, None, *start)
            error = opencv_squared_error(task, *pose)
            if error < least:
                best, least = pose, error
        return best

    return solve


def opencv_refine(task):
    rvec, tvec = task.start
    # The call writes into its arguments.
    return cv2.solvePnPRefineLM(task.points, task.pixels, task.k, None, rvec.copy(), tvec.copy())


def opencv_ransac(flag):
    """Refined on its inliers. Of its methods the minimal one is the fastest and loses nothing, USAC_ACCURATE does best on planes;
    with samples of five, as EPNP and SQPNP take them, it finds no consensus among six points."""

    def solve(task):
        found, rvec, tvec, inliers = cv2.solvePnPRansac(
            task.points,
            task.pixels,
            task.k,
            None,
            iterationsCount=1000,
            reprojectionError=task.gate_px,
            confidence=0.9999,
            flags=flag,
        )
        if not found or inliers is None:
            return None
        inliers = inliers[:, 0]
        return cv2.solvePnPRefineLM(task.points[inliers], task.pixels[inliers], task.k, None, rvec, tvec)

    return solve


def matrix_of_opencv(answer):
    rvec, tvec = answer
    return [*cv2.Rodrigues(rvec)[0].ravel().tolist(), *np.ravel(tvec).tolist()]


# PoseLib. Answers are a CameraPose or None.


def poselib_estimate(ransac):
    """Plain least squares on the inliers: of its losses the one that does best here."""

    def solve(task):
        options = {"max_reproj_error": task.gate_px, **ransac}
        pose, _ = poselib.estimate_absolute_pose(
            task.pixels, task.points, task.camera, options, {"loss_type": "TRIVIAL"}
        )
        return pose

    return solve


def poselib_refine(task):
    pose, _ = poselib.refine_absolute_pose(
        task.pixels, task.points, task.pose, task.camera, {"loss_type": "TRIVIAL"}
    )
    return pose


def poselib_p3p(task):
    poses = poselib.p3p(task.bearings, task.corners)
    return poses[0] if poses else None


def matrix_of_poselib(pose):
    return [*pose.R.ravel().tolist(), *pose.t.tolist()]


def methods():
    """Name, matrix of an answer, whether a study is taken, and the call."""
    clean = lambda study: not study["outliers"]
    planar = lambda study: study["planar"] and clean(study)
    spatial = lambda study: not study["planar"] and clean(study)
    smallest = lambda study: study["speed_count"] == 6
    any_study = lambda study: True
    if cv2:
        for name, takes, solve in [
            ("IPPE", planar, opencv(cv2.SOLVEPNP_IPPE)),
            ("AP3P", clean, opencv_four),
            ("EPNP", clean, opencv(cv2.SOLVEPNP_EPNP)),
            ("SQPNP", clean, opencv(cv2.SOLVEPNP_SQPNP)),
            ("ITERATIVE", clean, opencv(cv2.SOLVEPNP_ITERATIVE)),
            ("IPPE + LM", planar, opencv_refined(cv2.SOLVEPNP_IPPE)),
            ("SQPNP + LM", spatial, opencv_refined(cv2.SOLVEPNP_SQPNP)),
            ("RefineLM", clean, opencv_refine),
            ("Ransac AP3P + LM", any_study, opencv_ransac(cv2.SOLVEPNP_AP3P)),
            ("Ransac USAC + LM", any_study, opencv_ransac(cv2.USAC_ACCURATE)),
        ]:
            yield f"OpenCV {name}", matrix_of_opencv, takes, solve
    if poselib:
        for name, takes, solve in [
            ("p3p", smallest, poselib_p3p),
            ("refine", clean, poselib_refine),
            # As it comes it takes 1000 samples at least; with 20 it loses nothing here.
            ("estimate", any_study, poselib_estimate({"min_iterations": 20})),
            ("estimate as it comes", any_study, poselib_estimate({})),
        ]:
            yield f"PoseLib {name}", matrix_of_poselib, takes, solve


def solve_once(solve, tasks, times):
    answers = []
    for task, of_task in zip(tasks, times):
        start = perf_counter_ns()
        try:
            answer = solve(task)
        except cv2.error if cv2 else ():
            answer = None
        of_task.append(perf_counter_ns() - start)
        answers.append(answer)
    return answers


def finite(numbers):
    """JSON has no word for what is none."""
    return numbers if all(map(math.isfinite, numbers)) else None


def say(what):
    print(json.dumps(what), flush=True)


def main():
    say({"opencv": cv2 and cv2.__version__, "poselib": poselib and poselib.__version__})
    if not (cv2 or poselib):
        return
    studies = json.loads(sys.stdin.readline())
    tasks = {name: [Task(sent) for sent in study["tasks"]] for name, study in studies.items()}
    results = {}
    for line in sys.stdin:
        study = json.loads(line)
        known = results.setdefault(study, {})
        for name, matrix_of, takes, solve in methods():
            if takes(studies[study]):
                result = known.setdefault(name, {"times": [[] for _ in tasks[study]]})
                answers = solve_once(solve, tasks[study], result["times"])
                result["poses"] = [answer and finite(matrix_of(answer)) for answer in answers]
        say("")
    for known in results.values():
        for result in known.values():
            result["ns"] = [statistics.median(times) for times in result.pop("times")]
    say(results)


main()
