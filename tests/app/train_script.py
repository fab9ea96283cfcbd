#!/usr/bin/env python3
"""scripts/train --small from scans to evaluation, killed twice on its way, against thresholds of its
own: a model of few people, so looser than the shipped one's. About 10 minutes on 2 cores."""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time


def start(script, program, out):
    return subprocess.Popen([script, "--small", "--out", out], env={**os.environ, "SOLE_PROGRAM": program},
                            start_new_session=True)


def kill_when(process, ready):
    while process.poll() is None and not ready():
        time.sleep(0.2)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def main():
    program, script = sys.argv[1], sys.argv[2]
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder)
        registrations = out / "feet" / "registrations"
        training = out / "sole-foot.training"
        kill_when(start(script, program, folder), lambda: len(list(registrations.glob("*.npz"))) >= 3)
        assert not (out / "sole-foot.npz").exists()
        kill_when(start(script, program, folder), lambda: (training / "correctives.npz").exists())
        assert not (out / "sole-foot.npz").exists()
        kept = (training / "correctives.npz").stat().st_mtime_ns
        assert start(script, program, folder).wait() == 0
        assert (training / "correctives.npz").stat().st_mtime_ns == kept, "what was finished was made again"
        figures = json.loads((out / "evaluation.json").read_text())
        print(json.dumps(figures["ablation"], indent=1))
        table = figures["ablation"]
        assert table["full"]["contact_mm"] < table["linear"]["contact_mm"] < table["lbs"]["contact_mm"] + 0.02
        # Of so few people contact adds nothing to pose; it must not take away much either.
        assert table["full"]["contact_mm"] < table["linear"]["contact_mm"] - 0.1
        assert table["full"]["contact_mm"] < table["f_theta"]["contact_mm"] + 0.05
        assert figures["contact_response"]["flattening_share"] > 0.5
        assert table["full"]["contact_mm"] < 1.4 and table["full"]["noncontact_mm"] < 1.4
        assert figures["baseline"]["noncontact_mm"] > table["linear"]["noncontact_mm"] + 0.1
        assert figures["contact_response"]["free_mm"] < 0.4


main()
