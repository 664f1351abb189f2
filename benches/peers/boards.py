"""OpenCV's chessboard through its PyPI wheel, for the program in src/bin/calibrate.rs.

    boards.py FOLDER COLUMNS ROWS

Speaks through standard input and output, a line each way:

    {"opencv": "5.0.0"}     ->  what is installed
                            <-  <name of a picture>: its corners once
    [ms, count]             ->  milliseconds and corners; and so on, the program running its own in between

A call is timed from the gray picture to refined corners.
"""

import json
import pathlib
import sys
from time import perf_counter_ns

import cv2

# One core, as the other program.
cv2.setNumThreads(1)

# Until a corner moves by less than a thousandth of a pixel, as OpenCV's tutorial of calibration has it.
CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)


def corners(gray, size):
    found, places = cv2.findChessboardCorners(gray, size)
    return cv2.cornerSubPix(gray, places, (5, 5), (-1, -1), CRITERIA) if found else []


def main():
    folder, columns, rows = pathlib.Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    pictures = {}
    print(json.dumps({"opencv": cv2.__version__}), flush=True)
    for line in sys.stdin:
        name = line.rstrip("\n")
        if name not in pictures:
            pictures[name] = cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE)
        start = perf_counter_ns()
        found = corners(pictures[name], (columns, rows))
        print(json.dumps([(perf_counter_ns() - start) * 1e-6, len(found)]), flush=True)


main()
