#!/usr/bin/python3
"""Model files as others release them, written by numpy, against a plain float64 reference (foreign_files.py).

Argument: the sole program.
"""
import pathlib
import pickle
import subprocess
import sys
import tempfile
import unittest

import numpy as np

sys.dont_write_bytecode = True
from foreign_files import (add_hinges, as_chumpy, as_selection, as_sparse, forward, make_model, network_value,
                           python2_pickle, save_object_npy, shifted_quaternion)

PROGRAM = sys.argv.pop(1)


class Models(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self.folder.name)

    def tearDown(self):
        self.folder.cleanup()

    def sole(self, *arguments, status=0):
        result = subprocess.run([PROGRAM, "model", *map(str, arguments)], capture_output=True, text=True)
        self.assertEqual(result.returncode, status, result.stderr)
        return result.stdout + result.stderr

    def evaluate(self, path, poses, betas, translation, *options):
        for name, array in (("p", poses), ("b", betas), ("t", translation)):
            np.save(self.root / f"{name}.npy", array)
        self.sole("pose", path, "--pose", self.root / "p.npy", "--betas", self.root / "b.npy", "--trans",
                  self.root / "t.npy", "--out", self.root / "v.npy", "--joints", self.root / "j.npy", *options)
        return np.load(self.root / "v.npy"), np.load(self.root / "j.npy")

    def check(self, path, model, family, seed=3, convert=True):
        """The file itself and its conversion evaluate to the reference, in double and in single precision."""
        rng = np.random.default_rng(seed)
        joints, n = model["kintree_table"].shape[1], 3
        flat = model["axis_meta"]["num_pose"] if "axis_meta" in model else 3 * joints
        poses = rng.normal(0, 0.6, (n, flat))
        poses[0, :3] = 0
        betas = rng.normal(size=(n, model["shapedirs"].shape[2]))
        translation = rng.normal(size=(n, 3))
        expected = [forward(model, family, *row) for row in zip(poses, betas, translation)]
        given = poses if "axis_meta" in model else poses.reshape(n, joints, 3)
        runs = [(path, 1e-12), (path, 1e-6, "--single")]
        if convert:
            self.sole("convert", path, "--out", self.root / "ours.npz")
            runs.append((self.root / "ours.npz", 1e-12))
        for file, tolerance, *options in runs:
            vertices, centres = self.evaluate(file, given, betas, translation, *options)
            self.assertEqual(vertices.shape, (n,) + model["v_template"].shape)
            self.assertEqual(centres.shape, (n, joints, 3))
            for i, (v, j) in enumerate(expected):
                self.assertLess(np.abs(vertices[i] - v).max(), tolerance, file)
                self.assertLess(np.abs(centres[i] - j).max(), tolerance, file)

    def test_supr_foot_of_every_protocol(self):
        model = make_model("supr", 266, 13, 10, 1)
        path = self.root / "foot.npy"
        for protocol in range(6):
            with self.subTest(protocol=protocol):
                save_object_npy(path, model, protocol)
                if protocol in (2, 4):
                    self.check(path, model, "supr")
                else:
                    self.assertIn("vertices  266", self.sole("info", path))

    def test_single_precision_and_orders(self):
        model = make_model("supr", 266, 13, 10, 2, np.float32)
        save_object_npy(self.root / "m.npy", model, 2)
        self.check(self.root / "m.npy", model, "supr")
        model = make_model("supr", 40, 5, 3, 3)
        swapped = {key: np.asfortranarray(value.astype(value.dtype.newbyteorder(">"))) for key, value in model.items()}
        save_object_npy(self.root / "m.npy", swapped, 4)
        self.check(self.root / "m.npy", model, "supr")

    def test_supr_with_hinges(self):
        model = add_hinges(make_model("supr", 266, 13, 10, 4), 5)
        save_object_npy(self.root / "m.npy", model, 2)
        self.check(self.root / "m.npy", model, "supr")
        self.assertIn("2 hinges, 2 double hinges, 9 free joints", self.sole("info", self.root / "m.npy"))

    def test_body_sized_supr(self):
        """Every size of the released body: 300 shapes and 100 expressions."""
        model = make_model("supr", 10475, 75, 400, 6, np.float32)
        for key, scale in (("J_regressor", 0.1), ("shapedirs", 0.3), ("posedirs", 0.3)):
            model[key] *= np.float32(scale)  # a body of two metres
        save_object_npy(self.root / "m.npy", model, 4)
        self.check(self.root / "m.npy", model, "supr", convert=False)

    def test_star(self):
        model = make_model("star", 150, 24, 10, 7)
        np.savez(self.root / "m.npz", **model, extra=np.array({"a": [1, 2]}, object), bs_type=np.array(b"lrotmin"))
        self.check(self.root / "m.npz", model, "star")
        self.assertIn("STAR", self.sole("info", self.root / "m.npz"))

    def test_smpl_family(self):
        for name, joints, seed in (("SMPL", 24, 8), ("SMPL-H", 52, 9), ("SMPL-X", 55, 10), ("MANO", 16, 11), ("FLAME", 5, 12)):
            with self.subTest(name=name):
                model = make_model("smpl", 50, joints, 10, seed)
                model["kintree_table"] = model["kintree_table"].astype(np.uint32)  # the root's parent is 2^32 - 1
                np.savez_compressed(self.root / "m.npz", **model)
                self.check(self.root / "m.npz", model, "smpl")
                self.assertIn(f"{name} model", self.sole("info", self.root / "m.npz"))

    def test_pickles_with_chumpy_and_sparse_members(self):
        model = make_model("smpl", 80, 24, 10, 13)
        kinds = (("csc", as_chumpy), ("csr", as_selection))
        for protocol in range(6):
            for kind, wrap in (kinds if protocol == 2 else kinds[protocol % 2:protocol % 2 + 1]):
                with self.subTest(protocol=protocol, kind=kind):
                    file = dict(model, shapedirs=wrap(model["shapedirs"]), J_regressor=as_sparse(model["J_regressor"], kind),
                                v_template=as_chumpy(model["v_template"], "Reorder"), bs_style="lbs",
                                pose_training_info={"gender": "n", "count": 3, "scale": np.float64(2.5)}, none=None)
                    (self.root / "m.pkl").write_bytes(pickle.dumps(file, protocol=protocol))
                    if (protocol, kind) in ((0, "csc"), (2, "csr")):
                        self.check(self.root / "m.pkl", model, "smpl")
                    else:
                        self.assertIn("SMPL model", self.sole("info", self.root / "m.pkl"))

    def test_pickle_of_python_2(self):
        model = make_model("smpl", 100, 16, 5, 14)
        fortran = dict(model, posedirs=np.asfortranarray(model["posedirs"]))
        (self.root / "m.pkl").write_bytes(python2_pickle(fortran))
        self.check(self.root / "m.pkl", model, "smpl")

    def test_contact_network_of_every_kind(self):
        """Our own format, network added by numpy: told pose, pose and shape, or contact as well."""
        model = make_model("supr", 266, 13, 10, 22)
        save_object_npy(self.root / "m.npy", model, 4)
        self.sole("convert", self.root / "m.npy", "--out", self.root / "ours.npz")
        rng = np.random.default_rng(23)
        n, poses, betas = 3, rng.normal(0, 0.5, (3, 13, 3)), rng.normal(size=(3, 10))
        moves, contact = rng.normal(size=(n, 3)), rng.random((n, 266))
        contact[0] = contact[0] < 0.3
        np.save(self.root / "c.npy", contact)
        for inputs, told in ((52, "52 inputs: pose"), (54, "pose and shape"), (320, "pose, shape and contact")):
            sizes = [inputs, 256, 128, 64, 32, 16, 32, 64, 128, 3 * 266]
            layers = [(rng.normal(0, 1 / np.sqrt(a), (b, a)), rng.normal(0, 0.1, b)) for a, b in zip(sizes, sizes[1:])]
            layers[-1] = (layers[-1][0] * 0.01, layers[-1][1] * 0.01)
            named = {f"network_{name}_{i}": layer[k] for i, layer in enumerate(layers) for k, name in enumerate(("weight", "bias"))}
            np.savez(self.root / "net.npz", **np.load(self.root / "ours.npz"), **named)
            self.assertIn(told, self.sole("info", self.root / "net.npz"))
            for tolerance, *single in ((1e-12,), (1e-6, "--single")):
                vertices, _ = self.evaluate(self.root / "net.npz", poses, betas, moves, "--contact", self.root / "c.npy", *single)
                for i in range(n):
                    f = np.concatenate([shifted_quaternion(v) for v in poses[i]] + [betas[i, :2], contact[i]])[:inputs]
                    offsets = network_value(layers, f).reshape(-1, 3)
                    self.assertGreater(np.abs(offsets).max(), 1e-3)
                    v, _ = forward(model, "supr", poses[i].reshape(-1), betas[i], moves[i], offsets)
                    self.assertLess(np.abs(vertices[i] - v).max(), tolerance, told)

    def test_separated_part(self):
        """With the joints that it lost at rest, a part is the whole's slice; its joints are the whole's."""
        model = make_model("supr", 200, 13, 6, 15)
        chosen = np.random.default_rng(16).permutation(200)[:60]
        dropped = [4, 9, 12]
        weights, correctives = model["weights"], model["posedirs"]
        for j in dropped:
            weights[chosen, j] = 0
            correctives[chosen, :, 4 * j:4 * j + 4] = 0
        weights[chosen, 1] += 0.05
        model["weights"] = weights / weights.sum(axis=1, keepdims=True)
        save_object_npy(self.root / "m.npy", model, 4)
        np.save(self.root / "ids.npy", chosen)
        told = self.sole("separate", self.root / "m.npy", "--vertices", self.root / "ids.npy", "--out", self.root / "part.npz")
        kept = [j for j in range(13) if j not in dropped]
        self.assertIn(", ".join(map(str, kept)), told)
        part = np.load(self.root / "part.npz")
        for child, j in enumerate(kept):
            above = int(model["kintree_table"][0, j])
            while above in dropped:
                above = int(model["kintree_table"][0, above])
            self.assertEqual(part["kintree_table"][0, child], kept.index(above) if above >= 0 else -1)
        rng = np.random.default_rng(17)
        poses, betas, translation = rng.normal(0, 0.5, (2, 13, 3)), rng.normal(size=(2, 6)), rng.normal(size=(2, 3))
        poses[:, dropped] = 0
        vertices, joints = self.evaluate(self.root / "part.npz", poses[:, kept], betas, translation)
        for i in range(2):
            v, j = forward(model, "supr", poses[i].reshape(-1), betas[i], translation[i])
            self.assertLess(np.abs(vertices[i] - v[chosen]).max(), 1e-11)
            self.assertLess(np.abs(joints[i] - j[kept]).max(), 1e-11)

    def test_parts_of_every_family(self):
        for family in ("star", "smpl"):
            model = make_model(family, 80, 9, 4, 18)
            np.savez(self.root / "m.npz", **model)
            np.save(self.root / "ids.npy", np.arange(5, 50))
            self.sole("separate", self.root / "m.npz", "--vertices", self.root / "ids.npy", "--out", self.root / "part.npz")
            rng = np.random.default_rng(19)
            pose, beta, translation = rng.normal(0, 0.5, (1, 9, 3)), rng.normal(size=(1, 4)), np.zeros((1, 3))
            vertices, _ = self.evaluate(self.root / "part.npz", pose, beta, translation)
            expected, _ = forward(model, family, pose.reshape(-1), beta[0], translation[0])
            self.assertLess(np.abs(vertices[0] - expected[5:50]).max(), 1e-11)

    def expect_error(self, path, *parts):
        told = self.sole("info", path, status=1)
        self.assertEqual(told.count("\n"), 1, told)
        for part in (path.name,) + parts:
            self.assertIn(part, told)

    def test_files_that_are_no_models(self):
        path = self.root / "m.npy"
        model = make_model("supr", 40, 5, 3, 20)
        path.write_text("hello")
        self.expect_error(path, "neither npz nor npy nor a pickle")
        np.save(path, np.zeros((3, 3)))
        self.expect_error(path, "no dictionary")
        save_object_npy(path, {key: value for key, value in model.items() if key != "weights"}, 4)
        self.expect_error(path, "'weights'")
        save_object_npy(path, dict(model, weights=model["weights"][:-1]), 4)
        self.expect_error(path, "weights")
        save_object_npy(path, dict(model, posedirs=model["posedirs"][:, :, :-1]), 4)
        self.expect_error(path, "19 features")
        save_object_npy(path, dict(model, f=model["f"] + 40), 4)
        self.expect_error(path, "triangle")
        save_object_npy(path, dict(model, v_template=model["v_template"] * np.nan), 4)
        self.expect_error(path, "not numbers")
        save_object_npy(path, dict(model, evil=print), 4)
        self.expect_error(path, "'builtins.print'")
        whole = path.read_bytes()
        path.write_bytes(whole[:len(whole) // 2])
        self.expect_error(path)

    def test_wrong_batches(self):
        save_object_npy(self.root / "m.npy", make_model("supr", 40, 5, 3, 21), 4)
        good, betas, out = np.zeros((2, 5, 3)), np.zeros((2, 3)), self.root / "v.npy"
        for name, poses, shapes, part in (("joints", np.zeros((2, 4, 3)), betas, "pose values"), ("rows", good, np.zeros((3, 3)), "3 rows"),
                                          ("betas", good, np.zeros((2, 4)), "coefficients"), ("nan", good * np.nan, betas, "finite")):
            np.save(self.root / "p.npy", poses)
            np.save(self.root / "b.npy", shapes)
            told = self.sole("pose", self.root / "m.npy", "--pose", self.root / "p.npy", "--betas", self.root / "b.npy", "--out", out, status=1)
            self.assertIn(part, told, name)
            self.assertFalse(out.exists())


if __name__ == "__main__":
    unittest.main()
