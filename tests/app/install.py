#!/usr/bin/python3
"""The installed program, moved elsewhere, finds its models. Arguments: cmake, the build folder."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

BUILD = sys.argv.pop(2)
CMAKE = sys.argv.pop(1)


class Installed(unittest.TestCase):
    def test_fits_a_scan_without_naming_a_model(self):
        with tempfile.TemporaryDirectory() as temp:
            folder = pathlib.Path(temp)
            subprocess.run([CMAKE, "--install", BUILD, "--component", "sole", "--prefix", folder / "first"],
                           check=True, stdout=subprocess.DEVNULL)
            shutil.move(folder / "first", folder / "moved")
            model = np.load(folder / "moved/share/sole/models/sole-foot.npz")
            with open(folder / "foot.obj", "w") as scan:
                for x, y, z in 1e3 * model["fine_v_template"]:
                    scan.write(f"v {x:.4f} {y:.4f} {z:.4f}\n")
                for a, b, c in model["fine_f"] + 1:
                    scan.write(f"f {a} {b} {c}\n")
            environment = {k: v for k, v in os.environ.items() if k != "SOLE_MODELS"}
            subprocess.run([folder / "moved/bin/sole", "fit", "--scan", folder / "foot.obj"], cwd=folder, check=True,
                           env=environment, stdout=subprocess.DEVNULL)
            fit = np.load(folder / "foot-fit.npz")
            shipped = np.load(folder / "moved/share/sole/models/sole-foot-contact.npz")
            self.assertEqual(fit["beta"].size, shipped["shapedirs"].shape[2])
            self.assertEqual(list(fit["side"]), ["right"])


unittest.main()
