#!/usr/bin/python3
"""Khronos' glTF validator accepts Sole's GLB files without a word, and they hold what was written.
Arguments: the foreign_data program, validate_glb.js. Skipped (77) where the validator is not installed,
unless SOLE_REQUIRE_FOREIGN is set."""
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

import numpy as np

SCRIPT = sys.argv.pop(2)
PROGRAM = sys.argv.pop(1)
VERTICES = np.array([[0, 0, 0], [0.125, 0, 0], [0, 0.25, 0], [0, 0, 0.5], [1, 2, 3]])

folder = tempfile.TemporaryDirectory()
root = pathlib.Path(folder.name)
subprocess.run([PROGRAM, "write", str(root)], check=True)
names = ["still.glb", "moving.glb", "coloured.glb"]
validation = subprocess.run(["node", SCRIPT] + [str(root / n) for n in names], capture_output=True, text=True)
if validation.returncode == 77 and not os.environ.get("SOLE_REQUIRE_FOREIGN"):
    print(validation.stderr)
    sys.exit(77)
assert validation.returncode == 0, validation.stderr
reports = {pathlib.Path(k).name: v for k, v in json.loads(validation.stdout).items()}


def load(name):
    data = (root / name).read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + size]), data[28 + size:]


def array(gltf, binary, index):
    accessor = gltf["accessors"][index]
    view = gltf["bufferViews"][accessor["bufferView"]]
    dtype = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
    values = np.frombuffer(binary, dtype, accessor["count"] * width, view.get("byteOffset", 0))
    return values.reshape(-1, width)


class Glb(unittest.TestCase):
    def test_validator_finds_nothing(self):
        for name in names:
            issues = reports[name]["issues"]
            self.assertEqual((issues["numErrors"], issues["numWarnings"]), (0, 0), issues["messages"])
        self.assertEqual(reports["moving.glb"]["info"]["animationCount"], 1)
        self.assertEqual(reports["still.glb"]["info"]["animationCount"], 0)
        self.assertTrue(reports["moving.glb"]["info"]["hasMorphTargets"])
        self.assertEqual(reports["still.glb"]["info"]["generator"], "Sole")

    def test_positions_are_y_up_and_targets_relative(self):
        gltf, binary = load("moving.glb")
        primitive = gltf["meshes"][0]["primitives"][0]
        base = array(gltf, binary, primitive["attributes"]["POSITION"])
        expected = np.stack([VERTICES[:, 0], VERTICES[:, 2], -VERTICES[:, 1]], 1)
        np.testing.assert_array_equal(base, expected)
        self.assertEqual(len(primitive["targets"]), 3)
        for k, target in enumerate(primitive["targets"], 1):
            np.testing.assert_allclose(array(gltf, binary, target["POSITION"]), 0.1 * k * expected, atol=1e-6)
            np.testing.assert_allclose(array(gltf, binary, target["NORMAL"]), 0, atol=1e-6)
        normals = array(gltf, binary, primitive["attributes"]["NORMAL"])
        outwards = np.array([-4, -1, 2]) / np.sqrt(21)  # of three triangles, weighted by area, in glTF's axes
        np.testing.assert_allclose(normals[0], outwards, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)

    def test_each_frame_shows_its_own_target(self):
        gltf, binary = load("moving.glb")
        sampler = gltf["animations"][0]["samplers"][0]
        np.testing.assert_allclose(array(gltf, binary, sampler["input"]).ravel(), [0, 0.1, 0.2, 0.3], atol=1e-7)
        weights = array(gltf, binary, sampler["output"]).reshape(4, 3)
        np.testing.assert_array_equal(weights, np.vstack([np.zeros(3), np.eye(3)]))

    def test_colours(self):
        gltf, binary = load("coloured.glb")
        colours = array(gltf, binary, gltf["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
        np.testing.assert_array_equal(colours, np.tile([0.25, 0.5, 1], (5, 1)))


unittest.main(verbosity=2)
