#!/usr/bin/env python3
"""Draws tops on a pivot whose spin is slowed by one law, simulates them and writes what a fit needs.

    make_tops.py OUT LAW COUNT SEED [--lost SHARE]

The equations are those of Newton and Euler in body axes with a quaternion, moments and couples in SI units about the
pivot; `model/` has neither of these. LAW is the couple against the spin: dry, viscous or quadratic; each top also has a
viscous couple across its axis. One folder per case, OUT/LAW-SEED-NN, in the layout of make_tracks.py, so that score.py
fits them; path.csv is the path without noise and the spin rate. SHARE is the most of its spin that a top loses.
"""
import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

GRAVITY_M_S2 = 9.81


@dataclass
class Top:
    """Moments about the pivot, couples against the angular velocity: across, and dry + viscous + quadratic along."""
    I_kg_m2: float
    Is_kg_m2: float
    mass_kg: float
    l_m: float
    across_N_m_s: float = 0.0
    dry_N_m: float = 0.0
    viscous_N_m_s: float = 0.0
    quadratic_N_m_s2: float = 0.0

    def groups(self, spin_rad_s):
        """By the names of `trochoid fit`."""
        I, Is = self.I_kg_m2, self.Is_kg_m2
        return {"a_1_s2": self.mass_kg * GRAVITY_M_S2 * self.l_m / I, "b_1_s": Is * spin_rad_s / I, "l_m": self.l_m,
                "gamma1_1_s": self.across_N_m_s / I, "gamma3_1_s": self.viscous_N_m_s / Is,
                "gamma3_dry_1_s2": self.dry_N_m / I, "gamma3_quadratic": self.quadratic_N_m_s2 * I / Is**2}


def table_from_body(q):
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def derivative(top, sense, y):
    """y = quaternion, angular velocity in body axes; sense = sign of the spin, 0 once dry friction holds it."""
    (w, i, j, k), (p, q, r) = y[:4], y[4:]
    I, Is = top.I_kg_m2, top.Is_kg_m2
    up = table_from_body(y[:4]).T @ np.array([0.0, 0.0, 1.0])
    couple = np.cross([0.0, 0.0, top.l_m], -top.mass_kg * GRAVITY_M_S2 * up)
    couple[:2] -= top.across_N_m_s * y[4:6]
    couple[2] -= top.dry_N_m * sense + (top.viscous_N_m_s + top.quadratic_N_m_s2 * abs(r)) * r
    turning = 0.5 * np.array([-i * p - j * q - k * r, w * p + j * r - k * q, w * q + k * p - i * r, w * r + i * q - j * p])
    return np.concatenate([turning, [(couple[0] - (Is - I) * q * r) / I, (couple[1] - (I - Is) * p * r) / I, couple[2] / Is]])


def start_of(theta, phi, dtheta, dphi, spin):
    half = [0.5 * theta, 0.5 * phi]
    q = [np.cos(half[1]) * np.cos(half[0]), np.cos(half[1]) * np.sin(half[0]), np.sin(half[1]) * np.sin(half[0]),
         np.sin(half[1]) * np.cos(half[0])]
    return np.array([*q, dtheta, dphi * np.sin(theta), spin])


def simulate(top, start, t_s):
    """Rows of the state at the times; the spin stays at zero once dry friction has used it up."""
    def stops(_, y):
        return y[6]
    stops.terminal = True
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    sense = np.sign(start[6])
    run = solve_ivp(lambda _, y: derivative(top, sense, y), (0, t_s[-1]), start, t_eval=t_s,
                    events=stops if top.dry_N_m else None, **options)
    rows = run.y.T
    if run.status == 1:
        rest, stop_s = run.y_events[0][0].copy(), run.t_events[0][0]
        rest[6] = 0.0
        later = solve_ivp(lambda _, y: derivative(top, 0.0, y), (stop_s, t_s[-1]), rest, t_eval=t_s[t_s > stop_s], **options)
        rows = np.vstack([rows, later.y.T])
    return rows


def draw(random, law, most_lost):
    """A top, its start (theta, phi, dtheta, dphi, spin) and how long it is watched [s]."""
    m, R, l = random.uniform(0.05, 0.2), random.uniform(0.02, 0.05), random.uniform(0.02, 0.06)
    Is = m * R * R * random.uniform(0.5, 1.0)
    top = Top(0.5 * Is + m * l * l, Is, m, l)
    a = top.groups(0.0)["a_1_s2"]
    b = np.sqrt(a) * random.uniform(1.5, 4.5)
    spin, duration_s = float(b * top.I_kg_m2 / Is), float(random.choice([4, 8]))
    start = (random.uniform(0.2, 1.0), random.uniform(-np.pi, np.pi), b * random.uniform(-0.15, 0.15),
             a / b * random.uniform(0.3, 1.5), spin)
    lost = most_lost * random.uniform(0.25, 1.0)
    top.across_N_m_s = top.I_kg_m2 * random.uniform(0.04, 0.24) / duration_s
    if law == "dry":
        top.dry_N_m = Is * spin * lost / duration_s
    elif law == "viscous":
        top.viscous_N_m_s = -Is * np.log(1 - min(lost, 0.9)) / duration_s
    else:
        top.quadratic_N_m_s2 = Is * (1 / (1 - min(lost, 0.9)) - 1) / duration_s / spin
    return top, start, duration_s


def write_case(folder, law, random, most_lost):
    top, start, duration_s = draw(random, law, most_lost)
    t_s = np.arange(0.0, duration_s, 1 / random.choice([60, 120, 240]))
    y = simulate(top, start_of(*start), t_s)
    xy = top.l_m * np.array([table_from_body(row[:4])[:2, 2] for row in y])
    sigma_m = float(random.choice([5e-5, 2e-4]))
    seen = xy + sigma_m * random.standard_normal(xy.shape)
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "track.csv", "w") as file:
        file.write("# trochoid track 1\n# units: s, m, m^2, px, rad\nframe,t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2\n")
        for n, t in enumerate(t_s):
            file.write(f"{n},{t:.12g},{seen[n, 0]:.9g},{seen[n, 1]:.9g},{sigma_m**2:.6g},0,{sigma_m**2:.6g}\n")
    with open(folder / "path.csv", "w") as file:
        file.write("t_s,x_m,y_m,spin_rad_s\n")
        for n in range(0, len(t_s), max(1, len(t_s) // 100)):
            file.write(f"{t_s[n]:.12g},{xy[n, 0]:.13g},{xy[n, 1]:.13g},{y[n, 6]:.13g}\n")
    (folder / "scene.toml").write_text('[support]\nkind = "pivot"\n')
    theta, phi, dtheta, dphi, spin = start
    parameters = top.groups(spin) | {"theta_rad": theta, "phi_rad": phi, "dtheta_rad_s": dtheta, "dphi_rad_s": dphi}
    truth = {"parameters": {name: float(value) for name, value in parameters.items()}, "top": asdict(top),
             "spin_rad_s": spin, "spin_at_the_end_rad_s": float(y[-1, 6]), "sigma_m": sigma_m, "duration_s": duration_s}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("law", choices=["dry", "viscous", "quadratic"])
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--lost", type=float, default=0.6)
    given = parser.parse_args()
    for number in range(given.count):
        random = np.random.default_rng([given.seed, ord(given.law[0]), number])
        write_case(given.out / f"{given.law}-{given.seed}-{number:02d}", given.law, random, given.lost)


if __name__ == "__main__":
    main()
