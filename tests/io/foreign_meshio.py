#!/usr/bin/python3
"""meshio reads Sole's PLY, OBJ and STL files, and Sole reads meshio's PLY. Argument: the foreign_data program."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import meshio
import numpy as np

PROGRAM = sys.argv.pop(1)
VERTICES = np.array([[0, 0, 0], [0.125, 0, 0], [0, 0.25, 0], [0, 0, 0.5]])
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


class Meshio(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def written(self, name):
        subprocess.run([PROGRAM, "write", str(self.root)], check=True)
        return meshio.read(self.root / name)

    def test_ply_mesh(self):
        mesh = self.written("mesh.ply")
        np.testing.assert_array_equal(mesh.points, VERTICES)
        np.testing.assert_array_equal(mesh.cells_dict["triangle"], TRIANGLES)

    def test_obj(self):
        mesh = self.written("mesh.obj")
        np.testing.assert_array_equal(mesh.points, VERTICES)
        np.testing.assert_array_equal(mesh.cells_dict["triangle"], TRIANGLES)

    def test_stl_is_in_millimetres(self):
        mesh = self.written("mesh.stl")
        np.testing.assert_array_equal(mesh.points[mesh.cells_dict["triangle"]], 1000 * VERTICES[TRIANGLES])

    def test_ply_cloud(self):
        cloud = self.written("cloud.ply")
        x = np.arange(10) / 8 - 3
        np.testing.assert_array_equal(cloud.points, np.stack([x, 2 * x, -x], 1))
        np.testing.assert_array_equal(cloud.point_data["nz"], np.ones(10))
        np.testing.assert_array_equal(cloud.point_data["sigma"], np.full(10, 0.5))
        np.testing.assert_array_equal(cloud.point_data["intensity"], 10 * np.arange(10))
        np.testing.assert_array_equal(cloud.point_data["pair"], np.arange(10))

    def test_sole_reads_ply_of_meshio(self):
        for binary in (False, True):
            path = self.root / "a.ply"
            meshio.write(path, meshio.Mesh(VERTICES, [("triangle", TRIANGLES)]), binary=binary)
            text = subprocess.run([PROGRAM, "print-ply", str(path)], check=True, capture_output=True, text=True).stdout
            rows = [line.split() for line in text.splitlines()]
            np.testing.assert_array_equal([[float(v) for v in r[1:]] for r in rows if r[0] == "v"], VERTICES)
            np.testing.assert_array_equal([[int(v) for v in r[1:]] for r in rows if r[0] == "f"], TRIANGLES)


unittest.main(verbosity=2)
