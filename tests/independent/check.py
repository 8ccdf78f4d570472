#!/usr/bin/env python3
"""Holds rig.py against reference trajectories (REFERENCE folder of the project) and against its own balance of power.

    check.py REFERENCE
"""
import json
import sys
from pathlib import Path

try:
    import numpy as np
    from scipy.integrate import simpson

    from rig import Body, Laws, Rig, simulate
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

# Tilt [rad] and path [m]: ten times what the references' README states for an ordinary integration; for the exact law, of
# the reference's own error.
BOUNDS = {"s05_smooth_disc": (2e-4, 1e-12), "s06_roll_disc": (4e-8, 5e-9), "s07_roll_hoop_thin": (6e-8, 8e-9),
          "s08_slide_disc": (4e-6, 4e-7), "s09_ring_retrograde_drag": (3e-7, 4e-8), "s10_stick_slip_event": (4e-4, 3e-5)}
POWER_BOUND = 1e-3   # of the energy lost; sampled integrals, friction jumps between samples
FINER = 20           # samples of power per row


def run_reference(folder, name):
    told = json.loads((folder / f"{name}.json").read_text())
    p, at = told["params"], told["initial"]
    table = np.genfromtxt(folder / f"{name}.csv", delimiter=",", names=True)
    inner = 0.0 if p["kind"] == "disc" else np.sqrt(max(2 * p["C"] / p["m"] - p["R"] ** 2, 0.0))
    rolls = at.get("velocity") == "rolling"
    laws = Laws(None if rolls else p.get("mu") or 0.0, p.get("eps_v") or 0.0, p["mu_r"], p["mu_p"], p["mu_c"],
                np.array(p["c_air"]), np.array(p["q_air"]), p["c_v"], p["eps_omega"] or 0.01, p["g"])
    rig = Rig(Body(p["R"], 2 * p["h"], p["m"], inner), laws)
    start = rig.state(*(at[key] for key in ("phi", "theta", "psi", "w1", "w2", "w3", "x", "y")),
                      None if rolls else (at["vx"], at["vy"]))
    between = np.interp(np.arange(FINER * len(table) - FINER + 1) / FINER, np.arange(len(table)), table["t"])
    return rig, simulate(rig, start, between, 1e-10), table


def main():
    failed = False
    for name, (tilt_rad, path_m) in BOUNDS.items():
        rig, run, table = run_reference(Path(sys.argv[1]), name)
        tilt = np.abs(run.euler()[1][::FINER] - table["theta"]).max()
        path = np.hypot(*(run.y[::FINER, :2].T - [table["x"], table["y"]])).max()
        gained = rig.energy(run.y[-1]) - rig.energy(run.y[0])
        fed = simpson([rig.power(y, mode) for y, mode in zip(run.y, run.rolling())], x=run.t_s)
        balanced = abs(gained - fed) <= POWER_BOUND * abs(gained) + 1e-7 * rig.energy(run.y[0])
        good = tilt <= tilt_rad and path <= path_m and balanced
        failed |= not good
        print(f"{name}: tilt off {tilt:.1e} rad, path {path:.1e} m, energy {gained:.4e} J for {fed:.4e} J of power: "
              f"{'good' if good else 'NOT GOOD'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
