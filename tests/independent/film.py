#!/usr/bin/env python3
"""Tracks recordings with truth, and writes each as a case that score.py fits: from picture to parameter.

    film.py TROCHOID OUT FOLDER... [--jobs N]

FOLDER: a recording of one body with truth as `trochoid study tracking` reads them (others are passed over). OUT/PARENT-FOLDER gets
`track.csv`, `scene.toml`, which knows nothing of the motion's law, and `truth.json`: the coefficients object.json has under
`dynamics`, and the state at the track's first sample: what truth.csv says of it, rates by splines through its rows, or, at the
first frame, object.json. Needs numpy and scipy.
"""
import argparse
import csv
import json
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline

# By the names a fit prints; the first of clips/gen.py, the second of older recordings.
COEFFICIENTS = {"friction": "friction", "mu_coulomb": "friction", "rolling_friction_m": "rolling_friction_m",
                "mu_roll_m": "rolling_friction_m", "pivoting_friction_m": "pivoting_friction_m", "mu_pivot_m": "pivoting_friction_m",
                "contour_friction_m": "contour_friction_m", "air_force_N_s_m": "air_force_N_s_m", "c_v": "air_force_N_s_m",
                "a_s2": "a_1_s2", "b_at_frame0_s1": "b_1_s", "l_m": "l_m", "slip_regularisation_m_s": "slip_regularisation_m_s",
                "eps_v_m_s": "slip_regularisation_m_s"}
COUPLES = {"air_linear_N_m_s": "air_linear_N_m_s", "c_air": "air_linear_N_m_s", "air_quadratic_N_m_s2": "air_quadratic_N_m_s2",
           "q_air": "air_quadratic_N_m_s2"}
RATES = {"w1": "w1_rad_s", "w2": "w2_rad_s", "w3": "w3_rad_s", "vx": "vx_m_s", "vy": "vy_m_s", "dtheta0": "dtheta_rad_s",
         "dphi0": "dphi_rad_s"}
LOSSES = ["rolling_friction_m", "pivoting_friction_m", "contour_friction_m", "air_force_N_s_m", "gap_viscosity_Pa_s",
          *(f"air_{law}[{axis}]" for law in ("linear_N_m_s", "quadratic_N_m_s2") for axis in (1, 3))]
GRAVITY_M_S2 = 9.81


def top_groups(thing, w3_rad_s):
    """a = m g l / I and b = C w3 / I of a solid disc on a massless axle about its pivot."""
    m, R, d, l = thing["mass_kg"], thing["R_m"], thing["thickness_m"], thing["com_to_pivot_m"]
    I = m * (R * R / 4 + d * d / 12 + l * l)
    return {"a_1_s2": m * GRAVITY_M_S2 * l / I, "b_1_s": 0.5 * m * R * R * w3_rad_s / I, "l_m": l}


def coefficients(thing):
    """Everything object.json says of the law; a loss that it does not list is none."""
    law = thing["dynamics"]
    given = law.get("parameters", law)
    found = {name: given[key] for key, name in COEFFICIENTS.items() if isinstance(given.get(key), (int, float))}
    for key, name in COUPLES.items():
        if key in given:
            found |= {f"{name}[1]": given[key][0], f"{name}[3]": given[key][2]}
    if "com_to_pivot_m" in thing and "w3_rad_s" in given:
        found |= top_groups(thing, given["w3_rad_s"])
    return found if "l_m" in found else dict.fromkeys(LOSSES, 0.0) | found


def first_sample_s(track):
    with open(track) as lines:
        return float(next(csv.DictReader(line for line in lines if not line.startswith("#")))["t_s"])


def slope(t_s, values, row):
    """What splines of two degrees agree on; None where the rows are too far apart for that."""
    finer, coarser = (float(make_interp_spline(t_s, values, degree).derivative()(t_s[row])) for degree in (7, 5))
    return finer if abs(finer - coarser) < 1e-3 * abs(finer) + 1e-3 * np.ptp(values) / np.ptp(t_s) else None


def rates(rows, row, rolls):
    """Angular velocity in node axes, or Euler rates of a top; velocity of a body that is free to go."""
    t_s = np.array([float(r["t"]) for r in rows])
    moving = range(max(0, row - 20), min(len(rows), row + 60))  # what lies where it fell has a kink there
    by = {name: slope(t_s[moving], np.array([float(rows[i][name]) for i in moving]), row - moving[0])
          for name in ("theta_rad", "phi_rad", "psi_rad", "x_m", "y_m")}
    theta, dtheta, dphi, dpsi = float(rows[row]["theta_rad"]), by["theta_rad"], by["phi_rad"], by["psi_rad"]
    if not rolls:
        found = {"dtheta_rad_s": dtheta, "dphi_rad_s": dphi}
    else:
        found = {"w1_rad_s": dtheta, "vx_m_s": by["x_m"], "vy_m_s": by["y_m"],
                 "w2_rad_s": dphi and dphi * np.sin(theta), "w3_rad_s": dphi and dpsi and dpsi + dphi * np.cos(theta)}
    return {name: value for name, value in found.items() if value is not None}


def state(folder, thing, t_s):
    with open(folder / "truth.csv") as lines:
        rows = list(csv.DictReader(lines))
    at = min(range(len(rows)), key=lambda i: abs(float(rows[i]["t"]) - t_s))
    row = rows[at]
    rolls = "com_to_pivot_m" not in thing and "pivot_m" not in thing
    found = {name: float(row[name]) for name in ("theta_rad", "phi_rad")} | rates(rows, at, rolls)
    if rolls:
        found |= {name: float(row[name]) for name in ("x_m", "y_m")}
    at_first = thing["dynamics"].get("state_at_frame0", {}) if int(row["frame"]) == 0 else {}
    return found | {name: at_first[key] for key, name in RATES.items() if key in at_first}


def make_case(program, folder, out):
    case = out / f"{folder.parent.name}-{folder.name}"
    shutil.rmtree(case, ignore_errors=True)
    case.mkdir(parents=True)
    with open(case / "tracking.txt", "w") as log:
        subprocess.run([program, "study", "tracking", folder, "--out", case], stdout=log, stderr=log)
    tracks = list(case.glob("*.track.csv"))
    if not tracks:
        return f"{case.name}: no track, see {case / 'tracking.txt'}"
    tracks[0].rename(case / "track.csv")
    next(case.glob("*.scene.toml")).rename(case / "scene.toml")
    thing = json.loads((folder / "object.json").read_text())
    truth = coefficients(thing) | state(folder, thing, first_sample_s(case / "track.csv"))
    (case / "truth.json").write_text(json.dumps({"parameters": truth}, indent=1) + "\n")
    rms = [line for line in (case / "tracking.txt").read_text().splitlines() if "CoM rms" in line]
    return f"{case.name}: {rms[0].strip() if rms else 'not scored'}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=lambda name: Path(name).resolve())
    parser.add_argument("out", type=Path)
    parser.add_argument("folders", nargs="+", type=lambda name: Path(name).resolve())
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    filmed = [folder for folder in given.folders if (folder / "truth.csv").exists()]
    with ThreadPoolExecutor(given.jobs) as pool:
        for words in pool.map(lambda f: make_case(given.program, f, given.out), filmed):
            print(words, flush=True)


if __name__ == "__main__":
    main()
