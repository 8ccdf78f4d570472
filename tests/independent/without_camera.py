#!/usr/bin/env python3
"""Runs the cases of film.py from their recordings, without a camera, and compares with their truth.

    without_camera.py TROCHOID CASE... [--lean DEGREES] [--jobs N]

CASE: a folder that film.py made. Passed over are bodies on a pivot and, of cameras that lean by more than --lean, all. The folder of
the run is CASE/run. One line per case as score.py has it; place and azimuth are not compared, since a camera that the body tells has
axes of its own.
"""
import argparse
import json
import math
import subprocess
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from score import WRONG_SIGMAS, deviations

BY_AXES = ("x_m", "y_m", "phi_rad", "vx_m_s", "vy_m_s")


def lean_deg(camera):
    return math.degrees(math.acos(min(1.0, abs(camera["R_world_to_cam"][2][2]))))


def run(program, case, scene, video):
    text = (case / "scene.toml").read_text()
    named = f'file = "{scene["camera"]["file"]}"'
    assert named in text, f"{case}: scene.toml names its camera otherwise"
    (case / "bare.toml").write_text(text.replace(named, ""))
    with open(case / "run.log", "w") as log:
        subprocess.run([program, "run", video, "--scene", case / "bare.toml", "-o", case / "run"], stdout=log, stderr=log)
    fits = list((case / "run").glob("*.fit.json"))
    if not fits:
        return "told   " + (case / "run.log").read_text().strip()[-120:]
    fit = json.loads(fits[0].read_text())
    truth = json.loads((case / "truth.json").read_text())["parameters"]
    off = {name: value for name, value in deviations(fit, truth).items() if name not in BY_AXES}
    worst = max(off, key=lambda name: abs(off[name]), default=None)
    good = fit["verdict"] in ("good", "good_correlated")
    outcome = "told" if not good else "WRONG" if worst and abs(off[worst]) > WRONG_SIGMAS else "right"
    return f"{outcome:6} {fit['verdict']:16} {fit['model']}" + (f"; {worst} {off[worst]:+.1f}" if worst else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=lambda name: Path(name).resolve())
    parser.add_argument("cases", nargs="+", type=Path)
    parser.add_argument("--lean", type=float, default=5.0)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    asked = []
    for case in sorted(given.cases):
        scene = tomllib.loads((case / "scene.toml").read_text())
        camera = Path(scene["camera"]["file"])
        lean = lean_deg(json.loads(camera.read_text()))
        if lean <= given.lean and scene.get("support", {}).get("kind", "floor") == "floor" and scene["body"].get("kind") != "top":
            asked.append((case, lean, scene, camera.parent / "video.mp4"))
    with ThreadPoolExecutor(given.jobs) as pool:
        for (case, lean, *_), words in zip(asked, pool.map(lambda a: run(given.program, a[0], *a[2:]), asked)):
            print(f"{case.name:14} leans {lean:3.1f}  {words}", flush=True)


if __name__ == "__main__":
    main()
