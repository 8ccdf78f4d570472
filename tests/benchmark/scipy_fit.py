#!/usr/bin/python3
"""Fits the thesis' base case with scipy.optimize.least_squares + solve_ivp and with trochoid.

Both see the same tracks (100 Hz, noise 1 % of l). scipy starts 30-50 % off in every parameter;
trochoid gets no start. Times are wall-clock; trochoid's include starting the program and reading
the file. Success: chi-square within 0.1 % + 0.5 of the fit from the truth.

    tests/benchmark/scipy_fit.py build/release/bin/trochoid --count 5
"""
import argparse
import json
import pathlib
import subprocess
import tempfile
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

TRUTH = np.array([0.098, 0.75, 0.1, 0.0, 0.0, np.pi / 3, 0.0])  # a b l phi dphi theta dtheta
NOISE = 1e-3  # m


def path(p, t_s, rtol=1e-8):
    """Thesis 2.24-2.26; x = l sin(theta) sin(phi), y = -l sin(theta) cos(phi)."""
    a, b, l, phi, dphi, theta, dtheta = p

    def rates(_, s):
        sin, cos = np.sin(s[2]), np.cos(s[2])
        return [s[1], (b - 2 * s[1] * cos) * s[3] / sin, s[3],
                sin * (a + s[1] ** 2 * cos - b * s[1])]

    run = solve_ivp(rates, (t_s[0], t_s[-1]), [phi, dphi, theta, dtheta], method="DOP853",
                    t_eval=t_s, rtol=rtol, atol=rtol)
    if not run.success:
        return np.full(2 * len(t_s), 1e3)
    reach = l * np.sin(run.y[2])
    return np.concatenate([reach * np.sin(run.y[0]), -reach * np.cos(run.y[0])])


def fit_scipy(t_s, data, start):
    begin = time.perf_counter()
    result = least_squares(lambda p: (path(p, t_s) - data) / NOISE, start, method="lm",
                           x_scale=np.maximum(np.abs(start), 0.1), max_nfev=400)
    return time.perf_counter() - begin, 2 * result.cost


def fit_trochoid(program, folder, t_s, data):
    n = len(t_s)
    table = np.column_stack([t_s, data[:n], data[n:], np.full(n, NOISE**2), np.zeros(n),
                             np.full(n, NOISE**2)])
    np.savetxt(folder / "track.csv", table, delimiter=",", comments="",
               header="t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2")
    begin = time.perf_counter()
    subprocess.run([program, "fit", folder / "track.csv", "--model", "top", "-o",
                    folder / "fit.json"], stdout=subprocess.DEVNULL, check=False)
    elapsed = time.perf_counter() - begin
    values = {p["name"]: p["value"] for p in json.loads((folder / "fit.json").read_text())["parameters"]}
    p = [values[name] for name in ("a_1_s2", "b_1_s", "l_m", "phi_rad", "dphi_rad_s", "theta_rad",
                                   "dtheta_rad_s")]
    return elapsed, np.sum(((path(p, t_s, 1e-10) - data) / NOISE) ** 2)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--duration", type=float, default=10.0)
    options = parser.parse_args()
    random = np.random.default_rng(1)
    t_s = np.arange(0.0, options.duration + 1e-9, 0.01)
    exact = path(TRUTH, t_s, 1e-11)
    times, good = {"scipy": [], "trochoid": []}, {"scipy": 0, "trochoid": 0}
    with tempfile.TemporaryDirectory() as name:
        for _ in range(options.count):
            data = exact + NOISE * random.standard_normal(exact.size)
            off = random.uniform(0.3, 0.5, 7) * random.choice([-1, 1], 7)
            start = np.where(TRUTH != 0.0, TRUTH * (1 + off), off)
            best = fit_scipy(t_s, data, TRUTH)[1]
            for who, (seconds, chi2) in {
                    "scipy": fit_scipy(t_s, data, start),
                    "trochoid": fit_trochoid(options.program, pathlib.Path(name), t_s, data)}.items():
                times[who].append(seconds)
                good[who] += chi2 < 1.001 * best + 0.5
    for who, seconds in times.items():
        print(f"{who:9s} {good[who]}/{options.count} at the optimum, median {np.median(seconds):.3f} s")
    begin = time.perf_counter()
    subprocess.run([options.program, "--version"], stdout=subprocess.DEVNULL, check=False)
    print(f"of which starting the program {time.perf_counter() - begin:.3f} s")
    print(f"ratio of times {np.median(times['scipy']) / np.median(times['trochoid']):.0f}")


if __name__ == "__main__":
    main()
