#!/usr/bin/env python3
"""Draws bodies, losses and starts, simulates them with rig.py and writes what a fit needs.

    make_tracks.py OUT CLASS COUNT SEED [--angles yes|no|mixed]

One folder per case, OUT/CLASS-SEED-NN: track.csv (docs/formats.md), scene.toml (the body alone: no model is named) and
truth.json (state at the first sample and coefficients, by the names a fit prints). Classes:

    A  rolls, one to three random losses          D  smooth floor (angles always: the path is a straight line)
    B  spins in place while it slides fast        E  slides, friction sets in softly (1e-3 .. 1e-2 m/s)
    C  rolls first, slips later                   F  rolls and turns fast (60 .. 150 rad/s)
    G  as A, on a floor off level by 0.01 .. 0.5 degrees
"""
import argparse
import json
from pathlib import Path

import numpy as np

from rig import Body, Laws, Rig, simulate


def log_uniform(random, low, high):
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def draw_body(random):
    R = log_uniform(random, 0.012, 0.05)
    ring = random.random() < 0.5
    inner = R * random.uniform(0.6, 0.93) if ring else 0.0
    thickness = R * random.uniform(0.05, 0.4)
    density = log_uniform(random, 1200, 8900)
    return Body(R, thickness, density * np.pi * (R * R - inner * inner) * thickness, inner)


def draw_losses(random, body, most=3):
    """One to `most` of them; each alone would stop the body within seconds to a minute."""
    laws, R, m = Laws(), body.radius_m, body.mass_kg
    unit = m * np.sqrt(9.81 * R**3)
    names = ["rolling", "pivoting", "contour", "air", "quadratic", "drag"]
    for name in random.choice(names, random.integers(1, most + 1), replace=False):
        size = log_uniform(random, 3e-4, 5e-3)
        if name in ("rolling", "pivoting", "contour"):
            setattr(laws, name + "_friction_m", size * R)
        elif name == "drag":
            laws.air_force_N_s_m = m / log_uniform(random, 5.0, 50.0)
        else:
            couple = size * unit * np.array([1, 1, log_uniform(random, 0.3, 6.0)])
            if name == "air":
                laws.air_linear_N_m_s = couple
            else:
                laws.air_quadratic_N_m_s2 = couple / np.sqrt(9.81 / R) / 3
    return laws


def steady_precession(body, theta, w3):
    """Rate at which the tilt stays [rad/s]: the positive root of the balance of couples about the node line."""
    (A, C), R, h, m = body.moments(), body.radius_m, body.thickness_m / 2, body.mass_kg
    s, c = np.sin(theta), np.cos(theta)
    a = A * s * c + m * h * s * (R * s + h * c)
    b = -(C * s + m * R * (R * s + h * c)) * w3
    return max(np.roots([a, b, m * 9.81 * (h * s - R * c)]).real)


def draw_start(random, rig, fast, sliding_m_s):
    """Near steady motion, in either sense; sliding_m_s None: rolls."""
    rate = np.sqrt(9.81 / rig.body.radius_m)
    theta = np.radians(random.uniform(60, 82) if fast else random.uniform(35, 75))
    w3 = rate * random.uniform(-0.6, 0.6)
    precession = steady_precession(rig.body, theta, w3)
    if fast:                                     # a flicked coin: the turn about the vertical is what it has most of
        precession = random.uniform(60, 150)
        w3 = precession * np.cos(theta) * random.uniform(0.85, 1.1)
    w2 = precession * np.sin(theta) * random.uniform(0.9, 1.1)
    sense = random.choice([-1, 1])
    velocity = None
    if sliding_m_s is not None:
        heading = random.uniform(-np.pi, np.pi)
        velocity = sliding_m_s * np.array([np.cos(heading), np.sin(heading)])
    return rig.state(random.uniform(-np.pi, np.pi), theta, random.uniform(-np.pi, np.pi), random.uniform(-1.5, 1.5),
                     sense * w2, sense * w3, *random.uniform(-0.1, 0.1, 2), velocity)


def late_limit(rig, run):
    """Coulomb coefficient that is first asked for in mid run and clearly exceeded afterwards; None without one."""
    asked = np.array([rig.demand(y) for y in run.y])
    half = len(asked) * 2 // 5
    limit = 1.02 * asked[:half].max()
    return limit if 0.03 < limit < 0.6 and (asked[half:] > 1.1 * limit).mean() > 0.05 else None


def draw_scene(kind, random):
    """A case of a class: (rig, run over the times of its frames). Draws until the motion lasts."""
    while True:
        body = draw_body(random)
        laws = draw_losses(random, body, 2 if kind in "BE" else 3)
        t_s = np.arange(0.0, random.uniform(1.5, 2.5) if kind in "BDEF" else random.uniform(2.0, 5.0),
                        1 / (240 if kind == "F" else random.choice([60, 120, 240])))
        if kind in "BE":
            laws.friction = random.uniform(0.1, 0.4)
        if kind == "E":
            laws.slip_regularisation_m_s = log_uniform(random, 1e-3, 1e-2)
        if kind == "D":
            laws.friction = 0.0
        if kind == "G":
            towards, rise = random.uniform(-np.pi, np.pi), np.radians(log_uniform(random, 0.01, 0.5))
            laws.slope = (float(rise * np.cos(towards)), float(rise * np.sin(towards)))
        rig = Rig(body, laws)
        sliding = {"B": random.uniform(0.2, 0.8), "D": random.uniform(0.0, 0.4), "E": random.uniform(0.1, 0.6)}.get(kind)
        start = draw_start(random, rig, kind == "F", sliding)
        if rig.accelerations(start, laws.friction is None)[2][2] <= 0:
            continue
        run = simulate(rig, start, t_s)
        if kind == "C" and run.end == "reached the end":
            laws.friction = late_limit(rig, run)
            if laws.friction is None:
                continue
            run = simulate(rig, start, t_s)
            if run.rolling().all():
                continue
        if run.end == "reached the end" and plausible(rig, run):
            return rig, run


def plausible(rig, run):
    """Stays off the floor and off its edge, loses a noticeable part of its energy, and rolls on grip that exists."""
    theta = run.euler()[1]
    lost = 1 - rig.energy(run.y[-1]) / rig.energy(run.y[0])
    smooth = rig.laws.friction == 0.0
    grips = rig.laws.friction is not None or max(rig.demand(y) for y in run.y) < 0.6
    return theta.min() > 0.12 and theta.max() < 1.52 and (smooth or 0.01 < lost < 0.7) and grips


def truth_of(rig, run):
    """By the names of `trochoid fit`."""
    laws, y = rig.laws, run.y[0]
    n, e2, k, _, _ = rig.axes(y)
    phi, theta, psi = (float(angle[0]) for angle in run.euler())
    values = {"theta_rad": theta, "phi_rad": phi, "psi_rad": psi, "w1_rad_s": y[10:13] @ n, "w2_rad_s": y[10:13] @ e2,
              "w3_rad_s": y[10:13] @ k, "x_m": y[0], "y_m": y[1], "vx_m_s": y[3], "vy_m_s": y[4],
              "air_linear_N_m_s[1]": laws.air_linear_N_m_s[0], "air_linear_N_m_s[3]": laws.air_linear_N_m_s[2],
              "air_quadratic_N_m_s2[1]": laws.air_quadratic_N_m_s2[0],
              "air_quadratic_N_m_s2[3]": laws.air_quadratic_N_m_s2[2], "gap_viscosity_Pa_s": 0.0}
    for name in ("rolling_friction_m", "pivoting_friction_m", "contour_friction_m", "air_force_N_s_m"):
        values[name] = getattr(laws, name)
    values["slope_x"], values["slope_y"] = laws.slope
    if laws.friction is not None:
        values["friction"] = laws.friction
        values["slip_regularisation_m_s"] = laws.slip_regularisation_m_s
    slides = run.t_s[~run.rolling()]
    return {"parameters": {name: float(value) for name, value in values.items()},
            "rolls": bool(len(slides) == 0), "slides_from_s": float(slides[0]) if len(slides) else None,
            "duration_s": float(run.t_s[-1])}


def write_case(folder, rig, run, angles, random):
    folder.mkdir(parents=True, exist_ok=True)
    sigma_m = random.uniform(0.05, 0.2) / random.uniform(1200, 3000)   # pixels over pixels per metre
    sigma_rad = random.uniform(0.003, 0.01)
    xy = run.position()[:, :2] + sigma_m * random.standard_normal((len(run.t_s), 2))
    columns = [np.arange(len(run.t_s)), run.t_s, xy[:, 0], xy[:, 1], *[np.full(len(xy), s) for s in (sigma_m**2, 0.0, sigma_m**2)]]
    names = "frame,t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2"
    if angles:
        phi, theta, _ = run.euler()
        seen = [a + sigma_rad * random.standard_normal(len(a)) for a in (theta, phi)]
        columns += seen + [np.full(len(xy), sigma_rad)] * 2
        names += ",theta_rad,phi_rad,sigma_theta_rad,sigma_phi_rad"
    with open(folder / "track.csv", "w") as file:
        file.write("# trochoid track 1\n# units: s, m, m^2, px, rad\n" + names + "\n")
        for row in zip(*columns):
            file.write(f"{row[0]}," + ",".join(f"{value:.12g}" for value in row[1:]) + "\n")
    body = rig.body
    shape = f'kind = "ring"\ninner_radius_m = {body.inner_m!r}' if body.inner_m else 'kind = "disc"'
    (folder / "scene.toml").write_text(f"[body]\n{shape}\nradius_m = {body.radius_m!r}\nthickness_m = "
                                       f"{body.thickness_m!r}\nmass_kg = {float(body.mass_kg)!r}\n")
    truth = truth_of(rig, run) | {"angles": angles, "sigma_m": sigma_m}
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("kind", choices=list("ABCDEFG"))
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--angles", choices=["yes", "no", "mixed"], default="mixed")
    given = parser.parse_args()
    for number in range(given.count):
        random = np.random.default_rng([given.seed, ord(given.kind), number])
        rig, run = draw_scene(given.kind, random)
        angles = given.kind == "D" or given.angles == "yes" or (given.angles == "mixed" and number % 2 == 0)
        if given.kind == "F" and given.angles == "mixed":
            angles = False
        write_case(given.out / f"{given.kind}-{given.seed}-{number:02d}", rig, run, angles, random)


if __name__ == "__main__":
    main()
