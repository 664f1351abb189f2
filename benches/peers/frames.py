"""OpenCV and libjpeg-turbo through their PyPI wheels, for the program in src/bin/detect.rs.

    frames.py FOLDER

FOLDER holds the frames as JPEG. Speaks through standard input and output, a line each way:

    {"opencv": "5.0.0", "simplejpeg": null}  ->  what is installed
                                             <-  <name of a frame>: every method once on it
    ""                                       ->  done; and so on, the program running its own in between
                                             <-  end of input
    {frame: {method: [ms, ...]}}             ->  all times

A call is timed from decoded pixels (or, for decoders, from the file's bytes in memory) to its answer.
"""

import json
import pathlib
import sys
from time import perf_counter_ns

import cv2
import numpy as np

try:
    import simplejpeg
except ImportError:
    simplejpeg = None

# One core, as the other program.
cv2.setNumThreads(1)

CLOSING = cv2.getStructuringElement(cv2.MORPH_RECT, (3, 3))


def blobs(mask):
    """The fastest of OpenCV's algorithms with statistics: Bolelli's with labels of 16 bits, where they suffice."""
    return cv2.connectedComponentsWithStatsWithAlgorithm(mask, 8, cv2.CV_16U, cv2.CCL_BOLELLI)


# Of each size, so that no frame needs new memory.
KEPT = {}


def red_mask(bgr):
    size = bgr.shape[:2]
    if size not in KEPT:
        KEPT[size] = [np.empty(size, np.uint8) for _ in range(3)]
    red, green, mask = KEPT[size]
    cv2.extractChannel(bgr, 2, red)
    cv2.extractChannel(bgr, 1, green)
    cv2.threshold(cv2.subtract(red, green, red), 40, 255, cv2.THRESH_BINARY, mask)
    return cv2.morphologyEx(mask, cv2.MORPH_CLOSE, CLOSING, green)


def red_difference(bgr, _):
    return cv2.connectedComponentsWithStats(red_mask(bgr), connectivity=8)


def red_difference_tuned(bgr, _):
    return blobs(red_mask(bgr))


def red_in_range(bgr, _):
    hsv = cv2.cvtColor(bgr, cv2.COLOR_BGR2HSV)
    low, high = cv2.inRange(hsv, (0, 90, 50), (12, 255, 255)), cv2.inRange(hsv, (168, 90, 50), (180, 255, 255))
    mask = cv2.morphologyEx(cv2.bitwise_or(low, high), cv2.MORPH_CLOSE, CLOSING)
    return cv2.connectedComponentsWithStats(mask, connectivity=8)


def edges_tuned(side):
    """8 and 16 bits only, the magnitude as |dx| + |dy|, both derivatives in one pass."""

    def run(bgr, _):
        smooth = cv2.medianBlur(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), side)
        across, down = cv2.spatialGradient(smooth)
        magnitude = cv2.add(cv2.convertScaleAbs(across), cv2.convertScaleAbs(down))
        _, mask = cv2.threshold(magnitude, 51, 255, cv2.THRESH_BINARY)
        return blobs(mask)

    return run


def edges_obvious(side):
    def run(bgr, _):
        smooth = cv2.medianBlur(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), side)
        magnitude = cv2.magnitude(cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1))
        _, mask = cv2.threshold(magnitude, 51, 255, cv2.THRESH_BINARY)
        return cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)

    return run


def methods():
    yield "colour: OpenCV difference", red_difference
    yield "colour: OpenCV difference, CCL tuned", red_difference_tuned
    yield "colour: OpenCV HSV inRange", red_in_range
    yield "edge 3x3: OpenCV tuned", edges_tuned(3)
    yield "edge 3x3: OpenCV obvious", edges_obvious(3)
    # An odd side is all that it takes; the seed's window is 9 x 10.
    yield "edge thesis: OpenCV tuned, 9x9", edges_tuned(9)
    yield "decode: OpenCV to BGR", lambda _, file: cv2.imdecode(file, cv2.IMREAD_COLOR)
    yield "decode: OpenCV to luma", lambda _, file: cv2.imdecode(file, cv2.IMREAD_GRAYSCALE)
    if simplejpeg:
        yield "decode: libjpeg-turbo to RGB", lambda _, file: simplejpeg.decode_jpeg(file, "RGB")
        yield "decode: libjpeg-turbo to luma", lambda _, file: simplejpeg.decode_jpeg(file, "GRAY")
        if hasattr(simplejpeg, "decode_jpeg_yuv_planes"):
            yield "decode: libjpeg-turbo to planes", lambda _, file: simplejpeg.decode_jpeg_yuv_planes(file)


def say(what):
    print(json.dumps(what), flush=True)


def main():
    say({"opencv": cv2.__version__, "simplejpeg": simplejpeg and simplejpeg.__version__})
    folder = pathlib.Path(sys.argv[1])
    frames, times = {}, {}
    for line in sys.stdin:
        name = line.strip()
        if name not in frames:
            file = np.frombuffer((folder / name).read_bytes(), np.uint8)
            frames[name] = cv2.imdecode(file, cv2.IMREAD_COLOR), file
        known = times.setdefault(name, {})
        for method, run in methods():
            start = perf_counter_ns()
            run(*frames[name])
            known.setdefault(method, []).append((perf_counter_ns() - start) * 1e-6)
        say("")
    say(times)


main()
