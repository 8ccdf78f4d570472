#!/usr/bin/env python3
"""Fits the cases of make_tracks.py and compares with their truth.

    score.py TROCHOID FOLDER... [--limit SECONDS_OF_PROCESSOR] [--jobs N]

One line per case: outcome, verdict, processor seconds, chosen model, the parameter farthest off in its own error bars. Outcomes:

    right   called good, and every parameter it prints lies within 4 sigma of the truth
    WRONG   called good, and one does not (a coefficient whose term the truth lacks is compared with zero)
    told    not called good: weak, doubtful, unexplained, no feature, an error
    late    not done within the limit
"""
import argparse
import json
import math
import os
import resource
import signal
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

WRONG_SIGMAS = 4.0   # by chance once in a thousand fits of ten parameters


def fold(values):
    """The same motion by the other face's axis, so that the tilt is below a quarter turn."""
    if values.get("theta_rad", 0.0) <= math.pi / 2:
        return values
    turned = {name: -values[name] for name in ("w1_rad_s", "w3_rad_s") if name in values}
    return values | turned | {"theta_rad": math.pi - values["theta_rad"], "phi_rad": values["phi_rad"] + math.pi}


def deviations(fit, truth):
    """By name, in sigmas, of what the fit estimated."""
    estimated = {p["name"]: p for p in fit["parameters"] if p["status"] == "free" and isinstance(p["sigma"], (int, float))}
    values = fold({name: p["value"] for name, p in estimated.items()})
    off = {}
    for name, value in values.items():
        if name == "psi_rad" or name not in truth or not estimated[name]["sigma"] > 0:
            continue
        difference = value - truth[name]
        if name == "phi_rad":
            difference = math.remainder(difference, 2 * math.pi)
        off[name] = difference / estimated[name]["sigma"]
    return off


def score(program, folder, limit_s):
    truth = json.loads((folder / "truth.json").read_text())["parameters"]
    fit_file = folder / "fit.json"
    fit_file.unlink(missing_ok=True)
    command = [program, "fit", folder / "track.csv", "--scene", folder / "scene.toml", "-o", fit_file]
    with open(folder / "fit.log", "w") as log:
        child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=log,
                                 preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 1)))
        _, status, used = os.wait4(child.pid, 0)
    spent_s = used.ru_utime + used.ru_stime
    if os.WIFSIGNALED(status):
        ended = signal.Signals(os.WTERMSIG(status))
        return ("late" if ended == signal.SIGXCPU else "told"), f"{ended.name} after {spent_s:.0f} s"
    if not fit_file.exists():
        return "told", f"error: {(folder / 'fit.log').read_text().strip()[-200:]}"
    fit = json.loads(fit_file.read_text())
    chosen = next((m["model"] for m in fit["comparison"] if m["recommended"]), fit["model"])
    off = deviations(fit, truth)
    worst = max(off, key=lambda name: abs(off[name]), default=None)
    words = f"{fit['verdict']:16}{spent_s:6.1f} s  {chosen}" + (f"; {worst} {off[worst]:+.1f}" if worst else "")
    if fit["verdict"] not in ("good", "good_correlated"):
        return "told", words
    return "WRONG" if worst and abs(off[worst]) > WRONG_SIGMAS else "right", words


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=lambda name: Path(name).resolve())
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--limit", type=int, default=120, help="processor seconds of one fit")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    cases = sorted(track.parent for folder in given.folders for track in folder.rglob("track.csv"))
    totals = {}
    with ThreadPoolExecutor(given.jobs) as pool:
        for case, (outcome, words) in zip(cases, pool.map(lambda c: score(given.program, c, given.limit), cases)):
            print(f"{case.name:14} {outcome:6} {words}", flush=True)
            totals.setdefault(case.name.split("-")[0], Counter())[outcome] += 1
    for kind, counts in sorted(totals.items()):
        print(f"{kind}: " + ", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items())))


if __name__ == "__main__":
    main()
