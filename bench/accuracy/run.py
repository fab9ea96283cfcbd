#!/usr/bin/python3
"""Runs `sole demo` for some seeds and prints the figures against truth as a Markdown table.

    bench/accuracy/run.py --out /tmp/accuracy 1001 1002 1003 1004 1005 [-- demo options]

Seeds below 1000 are for development; judge with others. With --from-summaries nothing is run: OUT/SEED/summary.json are read.
"""
import argparse
import json
import pathlib
import subprocess
import sys

# Section, figure, what it must be ("<=" or ">=" and the limit); None: shown only.
FIGURES = [
    ("capture", "frames_lost", ("<=", 0)),
    ("calibration", "reprojection_rms_px", None),
    ("calibration", "heldout_rms_air_mm", None),
    ("calibration", "heldout_rms_glass_mm", None),
    ("reconstruction", "surface_rms_mm", ("<=", 0.3)),
    ("reconstruction", "surface_p95_mm", None),
    ("reconstruction", "sole_rms_mm", None),
    ("reconstruction", "sole_bias_mm", None),
    ("reconstruction", "completeness", (">=", 0.8)),
    ("reconstruction", "outliers", None),
    ("reconstruction", "seconds_per_frame", None),
    ("contact", "precision", None),
    ("contact", "recall", None),
    ("contact", "f1", (">=", 0.7)),
    ("contact", "plane_offset_mm", None),
    ("fit", "v2v_contact_mm", ("<=", 4)),
    ("fit", "v2v_noncontact_mm", ("<=", 4)),
    ("fit", "surface_mean_mm", None),
    ("fit", "seconds_per_frame", None),
    ("measure", "length_error_mm", ("<=", 2)),
    ("measure", "ball_width_error_mm", None),
    ("measure", "heel_width_error_mm", None),
    ("measure", "instep_height_error_mm", None),
    ("measure", "arch_height_error_mm", None),
]


def passes(value, limit):
    if value is None or limit is None:
        return True
    return value <= limit[1] if limit[0] == "<=" else value >= limit[1]


def text(value):
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def main():
    arguments = sys.argv[1:]
    extra = []
    if "--" in arguments:
        extra = arguments[arguments.index("--") + 1:]
        arguments = arguments[:arguments.index("--")]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="+", type=int)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder of the demos, one sub-folder a seed")
    parser.add_argument("--sole", default="build/release/app/sole", help="the program")
    parser.add_argument("--from-summaries", action="store_true", help="run nothing, read OUT/SEED/summary.json")
    options = parser.parse_args(arguments)

    summaries = []
    for seed in options.seeds:
        folder = options.out / str(seed)
        if not options.from_summaries:
            subprocess.run([options.sole, "demo", "--out", str(folder), "--seed", str(seed), *extra],
                           check=True, stdout=subprocess.DEVNULL)
        summaries.append(json.loads((folder / "summary.json").read_text()))

    print("| figure | limit |" + "".join(f" {seed} |" for seed in options.seeds))
    print("|---|---|" + "---|" * len(options.seeds))
    failed = 0
    for section, name, limit in FIGURES:
        values = [summary[section].get(name) for summary in summaries]
        marks = ["" if passes(value, limit) else " **over**" for value in values]
        failed += sum(mark != "" for mark in marks)
        shown = "" if limit is None else f"{limit[0]} {limit[1]}"
        print(f"| {section}.{name} | {shown} |" + "".join(f" {text(v)}{m} |" for v, m in zip(values, marks)))
    print("| total_seconds | |" + "".join(f" {text(s['total_seconds'])} |" for s in summaries))
    print(f"\n{summaries[0]['machine']}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
