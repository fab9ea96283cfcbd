"""Model files as others release them, written by numpy, and a plain float64 reference of what they mean.

chumpy and scipy need not be installed: classes of their names, made here, are what the pickles name.

    foreign_files.py DIR    writes small files of every layout, for fuzz_model to damage
"""
import io
import pathlib
import pickle
import sys
import types

import numpy as np


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


def forward(model, family, pose, beta, translation, offsets=0):
    """Vertices and joints; `offsets` are added to the vertices before skinning."""
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
    rest = shaped + real["posedirs"] @ feature + offsets
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


def network_value(layers, inputs):
    """Contact network: leaky ReLU after every layer but the last."""
    for i, (weight, bias) in enumerate(layers):
        inputs = weight @ inputs + bias
        if i + 1 < len(layers):
            inputs = np.where(inputs < 0, 0.1 * inputs, inputs)
    return inputs


def write_small_files(folder):
    """One small file of every layout that is read."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    supr = make_model("supr", 5, 3, 2, 1)
    for protocol in range(6):
        save_object_npy(folder / f"supr{protocol}.npy", supr, protocol)
    save_object_npy(folder / "supr_single.npy", make_model("supr", 5, 3, 2, 2, np.float32), 2)
    save_object_npy(folder / "supr_hinges.npy", add_hinges(make_model("supr", 5, 8, 2, 4), 5), 2)
    star = make_model("star", 5, 3, 2, 7, np.float32)
    np.savez(folder / "star.npz", **star, extra=np.array({"a": [1, 2]}, object))
    smpl = make_model("smpl", 5, 3, 2, 8)
    np.savez_compressed(folder / "smpl.npz", **smpl)
    (folder / "smpl_python2.pkl").write_bytes(python2_pickle(smpl))
    for protocol, kind, wrap in ((0, "csc", as_chumpy), (2, "csr", as_selection), (4, "csc", as_chumpy)):
        file = dict(smpl, shapedirs=wrap(smpl["shapedirs"]), J_regressor=as_sparse(smpl["J_regressor"], kind),
                    v_template=as_chumpy(smpl["v_template"], "Reorder"), bs_style="lbs", none=None)
        (folder / f"smpl_{kind}{protocol}.pkl").write_bytes(pickle.dumps(file, protocol=protocol))


if __name__ == "__main__":
    write_small_files(sys.argv[1])
