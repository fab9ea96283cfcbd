#!/usr/bin/env python3
"""Truth maps of `sole sim render` opened by numpy and compared with the true mesh. Argument: the program."""
import os
import subprocess
import sys
import tempfile

import numpy as np

RIG = """
name = "two cameras"
[[camera]]
serial = "L"
width = 300
height = 240
focal_px = 600
position_m = [-0.06, -0.25, 0.55]
look_at_m = [0, 0, 0.03]
[[camera]]
serial = "R"
width = 300
height = 240
focal_px = 600
position_m = [0.06, -0.25, 0.55]
look_at_m = [0, 0, 0.03]
[[pair]]
name = "pair"
left = "L"
right = "R"
[[simulation.projector]]
position_m = [0.0, -0.3, 0.6]
look_at_m = [0, 0, 0.03]
"""


def read_mesh(path):
    """Vertices (V, 3) and triangles (T, 3) of a binary PLY with lists of three."""
    with open(path, "rb") as file:
        vertices = faces = 0
        properties = []
        while True:
            words = file.readline().split()
            if words[0] == b"end_header":
                break
            if words[:2] == [b"element", b"vertex"]:
                vertices = int(words[2])
            elif words[:2] == [b"element", b"face"]:
                faces = int(words[2])
            elif words[0] == b"property" and faces == 0:
                properties.append((words[2].decode(), {b"float": "<f4", b"double": "<f8"}[words[1]]))
        points = np.frombuffer(file.read(vertices * np.dtype(properties).itemsize), properties)
        lists = np.frombuffer(file.read(), np.dtype([("n", "u1"), ("index", "<i4", 3)]), faces)
    return np.stack([points["x"], points["y"], points["z"]], 1), lists["index"]


def main():
    with tempfile.TemporaryDirectory() as folder:
        rig, take = os.path.join(folder, "rig.toml"), os.path.join(folder, "take")
        with open(rig, "w") as file:
            file.write(RIG)
        subprocess.run([sys.argv[1], "sim", "render", rig, "--out", take, "--seed", "5", "--frames", "1",
                        "--truth-maps"], check=True)
        points, triangles = read_mesh(os.path.join(take, "truth", "mesh", "000001.ply"))
        partners = 0
        for serial in "L", "R":
            maps = np.load(os.path.join(take, "truth", "maps", serial, "000001.npz"), allow_pickle=False)
            assert str(maps["format"]) == "sole-truth-maps" and int(maps["version"]) == 1
            mesh, depth = maps["mesh"], maps["depth_m"]
            assert mesh.shape == depth.shape == (240, 300)
            on = mesh == 0
            assert on.sum() > 3000 and (mesh[~on] == -1).all()
            assert np.isnan(depth[~on]).all() and np.isfinite(depth[on]).all()
            assert (0.3 < depth[on]).all() and (depth[on] < 0.8).all()
            corners = points[triangles[maps["triangle"][on]]]
            place = (maps["barycentric"][on][:, :, None] * corners).sum(1)
            assert np.abs(place - maps["point_m"][on]).max() < 1e-5
            assert np.abs(np.linalg.norm(maps["normal"][on], axis=1) - 1).max() < 1e-5
            lit, seen = maps["projectors"], maps["partners"]
            assert lit.max() == 1 and seen.max() == 1 and not lit[~on].any() and not seen[~on].any()
            assert 0.3 < lit[on].mean() <= 1
            partners += seen[on].mean()
        assert 0.6 < partners < 2
    print("truth maps agree with the true mesh")


if __name__ == "__main__":
    main()
