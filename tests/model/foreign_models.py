#!/usr/bin/python3
"""Model files as others release them, written by numpy, against a plain float64 reference.

Argument: the sole program. chumpy and scipy need not be installed: classes of their names, made here,
are what the pickles name.
"""
import io
import pathlib
import pickle
import subprocess
import sys
import tempfile
import types
import unittest

import numpy as np

PROGRAM = sys.argv.pop(1)


# ---- Reference forward function, one foot at a time.

def rotation(v):
    angle = np.linalg.norm(v)
    if angle == 0:
        return np.eye(3)
    x, y, z = v / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def shifted_quaternion(v):
    angle = np.linalg.norm(v)
    axis = v / angle if angle > 0 else v
    return np.append(np.sin(angle / 2) * axis, np.cos(angle / 2) - 1)


def released_product(q1, q2):
    """The product as the released code forms it: the second quaternion times the first."""
    x0, y0, z0, w0 = q1
    x1, y1, z1, w1 = q2
    return np.array([w1 * x0 + x1 * w0 + y1 * z0 - z1 * y0, w1 * y0 - x1 * z0 + y1 * w0 + z1 * x0,
                     w1 * z0 + x1 * y0 - y1 * x0 + z1 * w0, w1 * w0 - x1 * x0 - y1 * y0 - z1 * z0])


def joint_turns(model, pose):
    """Rotation and quaternion feature of every joint from the flat pose of the file."""
    meta = model.get("axis_meta")
    if meta is None:
        vectors = pose.reshape(-1, 3)
        return [rotation(v) for v in vectors], [shifted_quaternion(v) for v in vectors]
    axes = meta["axis"][:, meta["axis_indx"], :][0].astype(np.float64)
    turns, features = [], []
    for index in meta["indx_spherical"]:
        turns.append(rotation(pose[index]))
        features.append(shifted_quaternion(pose[index]))
    for index, axis in zip(meta["indx_hinge"], meta["indx_hinge_axis"]):
        turned = pose[index[0]] * axes[axis]
        turns.append(rotation(turned).T)
        features.append(shifted_quaternion(turned))
    for i1, a1, i2, a2 in zip(meta["indx_double_hinge1"], meta["indx_double_hinge1_axis"],
                              meta["indx_double_hinge2"], meta["indx_double_hinge2_axis"]):
        first, second = pose[i1] * axes[a1], pose[i2] * axes[a2]
        turns.append(rotation(first).T @ rotation(second).T)
        features.append(released_product(shifted_quaternion(first), shifted_quaternion(second)))
    order = meta["reverse_indx"]
    return [turns[i] for i in order], [features[i] for i in order]


def forward(model, family, pose, beta, translation):
    real = {key: np.asarray(value, np.float64) for key, value in model.items() if key != "axis_meta"}
    shaped = real["v_template"] + real["shapedirs"][:, :, :len(beta)] @ beta
    if family == "supr":
        joints = (real["J_regressor"] @ np.append(shaped.reshape(-1), 1)).reshape(-1, 3)
    else:
        joints = real["J_regressor"] @ shaped
    turns, features = joint_turns(model, pose)
    if family == "supr":
        feature = np.concatenate(features)
    elif family == "star":
        feature = np.append(np.concatenate(features[1:]), beta[1])
    else:
        feature = np.concatenate([(r - np.eye(3)).reshape(-1) for r in turns[1:]])
    rest = shaped + real["posedirs"] @ feature
    world = []
    for j in range(len(joints)):
        local = np.eye(4)
        local[:3, :3] = turns[j]
        parent = None if j == 0 else int(real["kintree_table"][0, j])
        local[:3, 3] = joints[j] - (joints[parent] if j else 0)
        world.append(local if j == 0 else world[parent] @ local)
    posed = np.zeros_like(rest)
    for j, m in enumerate(world):
        posed += real["weights"][:, j:j + 1] * ((rest - joints[j]) @ m[:3, :3].T + m[:3, 3])
    return posed + translation, np.array([m[:3, 3] for m in world]) + translation


# ---- Files.

def make_model(family, vertices, joints, betas, seed, dtype=np.float64):
    """Random tree, four influences a vertex, correctives of centimetres."""
    rng = np.random.default_rng(seed)
    weights = np.zeros((vertices, joints))
    for i in range(vertices):
        chosen = rng.choice(joints, min(4, joints), replace=False)
        weights[i, chosen] = rng.random(len(chosen))
    weights /= weights.sum(axis=1, keepdims=True)
    features = {"supr": 4 * joints, "star": 4 * joints - 3, "smpl": 9 * (joints - 1)}[family]
    tree = np.array([[-1] + [int(rng.integers(0, j)) for j in range(1, joints)], range(joints)])
    regressor = rng.random((joints, vertices)) * (rng.random((joints, vertices)) < 0.1)
    regressor[:, 0] += 0.01
    regressor /= regressor.sum(axis=1, keepdims=True)
    if family == "supr":
        regressor = rng.normal(0, 0.02, (3 * joints, 3 * vertices + 1))
    return {
        "v_template": rng.normal(0, 0.1, (vertices, 3)).astype(dtype),
        "f": rng.integers(0, vertices, (2 * vertices, 3)).astype(np.uint32),
        "kintree_table": tree, "weights": weights.astype(dtype),
        "shapedirs": rng.normal(0, 0.01, (vertices, 3, betas)).astype(dtype),
        "posedirs": rng.normal(0, 0.01, (vertices, 3, features)).astype(dtype),
        "J_regressor": regressor.astype(dtype),
    }


def add_hinges(model, seed):
    """Joints 2 and 5 become hinges, 3 and 7 double hinges; the pose values come in an order of their own."""
    rng = np.random.default_rng(seed)
    joints = model["kintree_table"].shape[1]
    hinges, doubles = [2, 5], [3, 7]
    free = [j for j in range(joints) if j not in hinges + doubles]
    count = 3 * len(free) + len(hinges) + 2 * len(doubles)
    places = list(rng.permutation(count))
    axis = rng.normal(size=(1, 9, 3))
    axis /= np.linalg.norm(axis, axis=2, keepdims=True)
    listed = free + hinges + doubles
    model["axis_meta"] = {
        "num_pose": count,
        "indx_spherical": [np.array([places.pop() for _ in range(3)]) for _ in free],
        "indx_hinge": [np.array([places.pop()]) for _ in hinges], "indx_hinge_axis": [0, 3],
        "indx_double_hinge1": [places.pop() for _ in doubles], "indx_double_hinge1_axis": np.array([1, 5]),
        "indx_double_hinge2": [places.pop() for _ in doubles], "indx_double_hinge2_axis": np.array([2, 4]),
        "reverse_indx": np.argsort(listed), "axis_indx": np.array([8, 0, 3, 5, 1, 2]), "axis": axis,
    }
    return model


def save_object_npy(path, value, protocol):
    """numpy.save of a 0-d object array, with a choice of protocol."""
    array = np.empty((), object)
    array[()] = value
    with open(path, "wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": ()})
        pickle.dump(array, file, protocol=protocol)


def foreign_class(module, name):
    """An empty class that pickles under a foreign name."""
    parts = module.split(".")
    for i in range(len(parts)):
        sys.modules.setdefault(".".join(parts[:i + 1]), types.ModuleType(parts[i]))
    made = type(name, (object,), {"__module__": module})
    setattr(sys.modules[module], name, made)
    return made


def as_chumpy(array, name="Ch"):
    """chumpy keeps its array as `x`, beside bookkeeping that must not matter."""
    wrapped = foreign_class("chumpy.ch" if name == "Ch" else "chumpy.reordering", name)()
    wrapped.__dict__.update({"x": array, "_dirty_vars": set(["x"]), "_itr": None, "_status": "new"})
    return wrapped


def as_selection(array):
    """chumpy's Select: elements of another array."""
    order = np.random.default_rng(1).permutation(array.size)
    stored = np.zeros(array.size)
    stored[order] = array.reshape(-1)
    wrapped = foreign_class("chumpy.reordering", "Select")()
    wrapped.__dict__.update({"a": as_chumpy(stored), "idxs": order.astype(np.int64), "preferred_shape": array.shape})
    return wrapped


def as_sparse(matrix, kind="csc"):
    lines = matrix.T if kind == "csc" else matrix
    indices = [np.flatnonzero(line) for line in lines]
    wrapped = foreign_class("scipy.sparse." + kind, kind + "_matrix")()
    wrapped.__dict__.update({
        "_shape": matrix.shape, "maxprint": 50, "data": np.concatenate([l[i] for l, i in zip(lines, indices)]),
        "indices": np.concatenate(indices).astype(np.int32),
        "indptr": np.cumsum([0] + [len(i) for i in indices]).astype(np.int32)})
    return wrapped


def python2_pickle(value):
    """Protocol 2 as Python 2 writes it: every text and every array's data a byte string (opcode U or T)."""
    out = io.BytesIO()

    def put(obj):
        if isinstance(obj, str):
            obj = obj.encode("latin1")
        if isinstance(obj, bytes):
            short = len(obj) < 256
            out.write(b"U" + bytes([len(obj)]) if short else b"T" + len(obj).to_bytes(4, "little"))
            out.write(obj)
        elif isinstance(obj, dict):
            out.write(b"}(")
            for key, item in obj.items():
                put(key)
                put(item)
            out.write(b"u")
        elif isinstance(obj, np.ndarray):
            out.write(b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R(K\x01(")
            for size in obj.shape:
                out.write(b"J" + size.to_bytes(4, "little"))
            out.write(b"tcnumpy\ndtype\n")
            put(obj.dtype.str[1:])
            out.write(b"K\x00K\x01\x87R(K\x03")
            put(obj.dtype.str[0])
            out.write(b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb")
            fortran = obj.ndim > 1 and not obj.flags.c_contiguous
            out.write(b"\x89" if not fortran else b"\x88")
            put(obj.tobytes("F" if fortran else "C"))
            out.write(b"tb")
        else:
            raise TypeError(type(obj))

    out.write(b"\x80\x02")
    put(value)
    return out.getvalue() + b"."


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

    def evaluate(self, path, poses, betas, translation):
        for name, array in (("p", poses), ("b", betas), ("t", translation)):
            np.save(self.root / f"{name}.npy", array)
        self.sole("pose", path, "--pose", self.root / "p.npy", "--betas", self.root / "b.npy", "--trans",
                  self.root / "t.npy", "--out", self.root / "v.npy", "--joints", self.root / "j.npy")
        return np.load(self.root / "v.npy"), np.load(self.root / "j.npy")

    def check(self, path, model, family, seed=3, tolerance=1e-12):
        """The file itself and its conversion evaluate to the reference."""
        rng = np.random.default_rng(seed)
        joints, n = model["kintree_table"].shape[1], 3
        flat = model["axis_meta"]["num_pose"] if "axis_meta" in model else 3 * joints
        poses = rng.normal(0, 0.6, (n, flat))
        poses[0, :3] = 0
        betas = rng.normal(size=(n, model["shapedirs"].shape[2]))
        translation = rng.normal(size=(n, 3))
        expected = [forward(model, family, *row) for row in zip(poses, betas, translation)]
        given = poses if "axis_meta" in model else poses.reshape(n, joints, 3)
        ours = self.root / "ours.npz"
        self.sole("convert", path, "--out", ours)
        for file in (path, ours):
            vertices, centres = self.evaluate(file, given, betas, translation)
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
        self.check(self.root / "m.npy", model, "supr", tolerance=1e-6)
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
        model = make_model("supr", 200, 75, 20, 6, np.float32)
        save_object_npy(self.root / "m.npy", model, 4)
        self.check(self.root / "m.npy", model, "supr", tolerance=2e-6)

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
