#!/usr/bin/python3
"""Layer test: no stage includes another, core includes nothing of ours but core, io only core, and no
public header includes a device, vision or ray-tracing library."""
import pathlib
import re
import sys

STAGES = ["capture", "calib", "recon", "contact", "model", "sim"]
ALLOWED = {"core": {"core"}, "io": {"core", "io"}, **{s: {"core", "io", s} for s in STAGES},
           "app": {"core", "io", "app", *STAGES}}
PRIVATE = re.compile(r"^(arv|gpiod|embree|opencv2|pcl|ceres|tiny_gltf)")

root = pathlib.Path(sys.argv[1])
problems = []
checked = 0
for folder, allowed in ALLOWED.items():
    for path in sorted((root / folder).rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        checked += 1
        for number, line in enumerate(path.read_text().splitlines(), 1):
            where = f"{path.relative_to(root)}:{number}"
            ours = re.match(r'\s*#\s*include\s+"([a-z]+)/', line)
            if ours and ours.group(1) not in allowed:
                problems.append(f"{where}: {folder}/ must not include {ours.group(1)}/")
            foreign = re.match(r'\s*#\s*include\s+[<"]([^>"]+)', line)
            if foreign and path.suffix == ".h" and not path.stem.endswith("_internal") and PRIVATE.match(foreign.group(1)):
                problems.append(f"{where}: public header includes {foreign.group(1)}")
print("\n".join(problems) or f"{checked} files respect the layers")
sys.exit(1 if problems or checked == 0 else 0)
