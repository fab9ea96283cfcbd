#!/usr/bin/python3
"""The page of `sole record --view` in headless Chromium: every camera with its picture and its counters.
Argument: the program. Skipped (77) where Chromium is not installed, unless SOLE_REQUIRE_FOREIGN is set."""
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

PROGRAM = sys.argv[1]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
if not CHROMIUM:
    print("skipped: Chromium is not installed: apt-get install chromium")
    sys.exit(1 if os.environ.get("SOLE_REQUIRE_FOREIGN") else 77)

CAMERAS = 2
RIG = """name = "view"
[trigger]
rate_hz = 10
bus_port = 17961
"""
for i in range(CAMERAS):
    RIG += f"""[[camera]]
serial = "VIEW{i + 1}"
address = "127.0.115.{i + 1}"
width = 320
height = 240
focal_px = 640
position_m = [{0.06 * (2 * i - 1)}, 0.0, -0.66]
up = [0.0, 1.0, 0.0]
"""
RIG += '[[pair]]\nname = "below"\nleft = "VIEW1"\nright = "VIEW2"\n'


def wait_for(process, path, text, seconds):
    """The log once it holds `text`."""
    end = time.time() + seconds
    while time.time() < end:
        log = path.read_text()
        if text in log:
            return log
        assert process.poll() is None, log
        time.sleep(0.1)
    raise AssertionError(f"no '{text}' in: {path.read_text()}")


with tempfile.TemporaryDirectory() as folder:
    root = pathlib.Path(folder)
    (root / "rig.toml").write_text(RIG)
    programs = []
    try:
        def start(name, *arguments):
            log = root / f"{name}.log"
            with open(log, "w") as out:
                programs.append(subprocess.Popen([PROGRAM, *arguments], stdout=out, stderr=out,
                                                 stdin=subprocess.DEVNULL))
            return programs[-1], log

        serve, log = start("serve", "sim", "serve", str(root / "rig.toml"), "--calibration", "--frames", "1", "--seed", "5")
        wait_for(serve, log, "serving", 120)
        record, log = start("record", "record", str(root / "rig.toml"), "--texture", "--subject", "S1", "--frames", "0",
                            "--seconds", "200", "--take", str(root / "take"), "--view", "0")
        url = re.search(r"http://127\.0\.0\.1:\d+/", wait_for(record, log, "live view: http", 60)).group()
        wait_for(record, log, "recording ", 60)

        end = time.time() + 60
        while True:  # the first pictures take a moment
            status = json.load(urllib.request.urlopen(url + "status.json"))
            try:
                pictures = [urllib.request.urlopen(f"{url}camera/{i}.jpg").read() for i in range(CAMERAS)]
                break
            except urllib.error.HTTPError:
                assert time.time() < end
                time.sleep(0.2)
        assert all(p.startswith(b"\xff\xd8") for p in pictures)
        assert [c["serial"] for c in status["cameras"]] == ["VIEW1", "VIEW2"]
        for missing in ("camera/2.jpg", "camera/x.jpg", "etc/passwd"):
            try:
                urllib.request.urlopen(url + missing)
                raise AssertionError(f"{missing} was served")
            except urllib.error.HTTPError as error:
                assert error.code == 404

        dom = subprocess.run([CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={root / 'profile'}",
                              "--virtual-time-budget=4000", "--dump-dom", url],
                             capture_output=True, text=True, timeout=120).stdout
        for serial in ("VIEW1", "VIEW2"):
            assert re.search(rf"<figcaption>{serial}: [1-9]\d* frames, \d+ lost", dom), dom
        assert dom.count('data-width="320"') == CAMERAS, dom
        assert re.search(r"<h1[^>]*>recording: \d+ triggers", dom), dom
        shot = os.environ.get("SOLE_SCREENSHOT")
        if shot:
            subprocess.run([CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={root / 'profile'}",
                            "--virtual-time-budget=4000", "--window-size=1000,600", f"--screenshot={shot}", url],
                           capture_output=True, timeout=120)
        record.send_signal(signal.SIGINT)
        assert record.wait(60) == 0, log.read_text()
    finally:
        for program in programs:
            if program.poll() is None:
                program.send_signal(signal.SIGINT)
                program.wait(60)
print("two cameras with pictures and counters")
