#!/usr/bin/python3
"""A pair written by numpy goes through `sole match`; numpy reads the disparity. Argument: the program."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

PROGRAM = sys.argv.pop(1)
SHIFT = 7.25


def write_pfm(path, image, big_endian):
    with open(path, "wb") as file:
        file.write(b"Pf\n%d %d\n%g\n" % (image.shape[1], image.shape[0], 1 if big_endian else -1))
        file.write(image[::-1].astype(">f4" if big_endian else "<f4").tobytes())


def read_pfm(path):
    with open(path, "rb") as file:
        assert file.readline() == b"Pf\n"
        width, height = map(int, file.readline().split())
        order = "<f4" if float(file.readline()) < 0 else ">f4"
        return np.frombuffer(file.read(), order).reshape(height, width)[::-1]


def texture(x, y):
    """Sum of waves: it can be shifted exactly."""
    random = np.random.default_rng(3)
    total = np.zeros_like(x)
    for _ in range(60):
        angle, wave, phase = random.uniform(0, 2 * np.pi), random.uniform(5, 12), random.uniform(0, 2 * np.pi)
        total += np.cos(2 * np.pi / wave * (np.cos(angle) * x + np.sin(angle) * y) + phase)
    return 0.5 + total / 60


class NumpyPair(unittest.TestCase):
    def test_disparity(self):
        y, x = np.mgrid[0:100, 0:180].astype(float)
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            write_pfm(folder / "left.pfm", texture(x, y), big_endian=True)
            write_pfm(folder / "right.pfm", texture(x + SHIFT, y), big_endian=False)
            subprocess.run([PROGRAM, "match", folder / "left.pfm", folder / "right.pfm", "--disparities", "32",
                            "--out", folder / "out.pfm"], check=True, capture_output=True)
            disparity = read_pfm(folder / "out.pfm")
        self.assertEqual(disparity.shape, (100, 180))
        known = np.isfinite(disparity)
        self.assertGreater(known.mean(), 0.65)  # windows stay inside both images
        self.assertTrue(np.isposinf(disparity[~known]).all())
        self.assertLess(np.sqrt(np.mean((disparity[known] - SHIFT) ** 2)), 0.005)


if __name__ == "__main__":
    unittest.main()
