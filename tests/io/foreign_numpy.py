#!/usr/bin/python3
"""numpy reads Sole's arrays, and Sole reads numpy's. Argument: the foreign_data program."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

PROGRAM = sys.argv.pop(1)


def run(action, path):
    return subprocess.run([PROGRAM, action, str(path)], check=True, capture_output=True, text=True).stdout


def parse(text):
    """{name: (dtype, shape, values)} of foreign_data's listing."""
    result = {}
    for line in text.splitlines():
        name, dtype, shape, values = line.split("\t")
        values = values.split("|")[:-1] if "U" in dtype else [float(v) for v in values.split()]
        result[name] = (dtype, tuple(int(n) for n in shape.split()), values)
    return result


class NumpyReads(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.folder.name)
        run("write", cls.root)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_arrays(self):
        matrix = (np.arange(24) / 8 - 3).reshape(4, 6)
        expected = {
            "matrix": matrix, "cube": matrix.reshape(4, 2, 3),
            "integers": np.array([[1, -2, 3], [-4, 5, 2**31 - 1]], "<i4"),
            "long": np.array([1, -(2**40)], "<i8"), "bits": np.ones(5000, "u1"), "nan": np.array([np.nan]),
            "empty": np.zeros((0, 3)), "scalar": np.array(7, "<i4"),
            "text": np.array("Größe \U0001F9B6"), "texts": np.array(["right", "", "left"]),
        }
        with np.load(self.root / "arrays.npz", allow_pickle=False) as read:
            self.assertEqual(set(read.files), set(expected))
            for name, array in expected.items():
                self.assertEqual(read[name].dtype, array.dtype, name)
                self.assertEqual(read[name].shape, array.shape, name)
                np.testing.assert_array_equal(read[name], array, name)
        np.testing.assert_array_equal(np.load(self.root / "matrix.npy", allow_pickle=False), matrix)

    def test_fit(self):
        with np.load(self.root / "fit.npz", allow_pickle=False) as fit:
            self.assertEqual(str(fit["format"]), "sole-fit")
            self.assertEqual(int(fit["version"]), 1)
            np.testing.assert_array_equal(fit["frames"], [4, 5])
            self.assertEqual(fit["theta"].shape, (2, 2, 3))
            self.assertEqual(fit["vertices_m"].shape, (2, 5, 3))
            self.assertEqual(fit["vertices_m"][0, 4, 1], 0.25)
            self.assertTrue(np.isnan(fit["vertices_m"][1]).all())
            self.assertEqual(fit["registration_fine_m"].shape, (2, 9, 3))
            self.assertEqual(list(fit["side"]), ["left", "right"])
            self.assertEqual(list(fit["verdict"]), ["good", "no foot"])


class SoleReads(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        base = np.arange(24).reshape(2, 3, 4) / 8 - 3
        self.arrays = {
            "c": base, "fortran": np.asfortranarray(base), "single": base.astype("<f4"), "big": base.astype(">f8"),
            "big_fortran": np.asfortranarray(base.astype(">i4")), "bool": base > 0, "byte": np.arange(256, dtype="u1"),
            "short": np.array([-32768, 32767], ">i2"), "word": np.array([0, 2**32 - 1], "<u4"),
            "sliced": base[:, ::2, 1:], "scalar": np.array(2.5), "empty": np.zeros((3, 0, 2)),
            "text": np.array(["äöü", "foot \U0001F9B6", ""]), "big_text": np.array(["ab", "c"], ">U3"),
        }

    def check(self, read):
        self.assertEqual(set(read), set(self.arrays))
        for name, array in self.arrays.items():
            dtype, shape, values = read[name]
            self.assertEqual(dtype, array.dtype.newbyteorder("<").str, name)
            self.assertEqual(shape, array.shape, name)
            self.assertEqual(values, array.ravel().tolist(), name)

    def test_stored(self):
        np.savez(self.root / "a.npz", **self.arrays)
        self.check(parse(run("print-npz", self.root / "a.npz")))

    def test_compressed(self):
        np.savez_compressed(self.root / "a.npz", **self.arrays)
        self.check(parse(run("print-npz", self.root / "a.npz")))

    def test_npy_versions(self):
        for version in [(1, 0), (2, 0), (3, 0)]:
            with open(self.root / "a.npy", "wb") as file:
                np.lib.format.write_array(file, self.arrays["fortran"], version=version)
            _, shape, values = parse(run("print-npy", self.root / "a.npy"))["array"]
            self.assertEqual(shape, (2, 3, 4))
            self.assertEqual(values, self.arrays["fortran"].ravel().tolist())

    def test_objects_are_refused(self):
        np.save(self.root / "a.npy", np.array([{}, None], dtype=object), allow_pickle=True)
        result = subprocess.run([PROGRAM, "print-npy", self.root / "a.npy"], capture_output=True, text=True)
        self.assertEqual(result.returncode, 1)
        self.assertIn("a.npy: holds Python objects", result.stderr)


unittest.main(verbosity=2)
