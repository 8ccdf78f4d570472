#!/usr/bin/python3
"""Recordings with truth that the project's renderer, camera and model had no part in.

    gen.py OUT LO HI [--seed N] [--readout FRACTION] [--tracer PATH]

writes OUT/LO .. OUT/HI-1, each with video.mp4, truth.csv, camera.json, object.json and scene.json, in the layout that
`trochoid study tracking OUT/*` reads. What is filmed, how it moves and through which camera is drawn from --seed and the
clip's number; --readout has its rows read one after the other, in that part of the time from picture to picture. Light comes from tracer.cpp beside this file (compiled beside OUT when it is newer), motion from ../rig.py, the
sensor (blur, exposure, transfer curve, noise) and H.264 from here. Needs numpy, scipy, g++, ffmpeg.
"""
import argparse, json, subprocess, sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.ndimage import gaussian_filter

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import rig

G, STEPS = 9.81, 12     # poses per exposure of a row


# --- Motion: (times) -> positions n x 3 [m], attitudes as (phi, theta, psi) n x 3 ------------------------------------
def roll(rng, body, t_s):
    """A disc or ring on the floor near a steady roll, freely rolling, sliding or wobbling down to rest; None: not filmable."""
    R, h, m, (A, C) = body.radius_m, body.thickness_m / 2, body.mass_kg, body.moments()
    kind, rate = rng.choice(["roll", "slide", "wobble"]), np.sqrt(G / R)
    theta = rng.uniform(0.25, 0.8) if kind == "wobble" else rng.uniform(0.5, 1.3)
    W = rng.choice([-1, 1]) * rate * (rng.uniform(1.5, 2.3) if kind == "wobble" else rng.uniform(0.3, 1.6))
    s, c = np.sin(theta), np.cos(theta)
    w3 = ((A * W * W * s * c + m * W * (R * s + h * c) * h * W * s + m * G * (h * s - R * c))
          / (W * (C * s + m * R * (R * s + h * c))))                    # steady roll, linear in w3
    air = 10 ** rng.uniform(-2.5, -0.7) * C * rate / 30 * np.array([1, 1, rng.uniform(0.2, 1)])
    loss = rng.uniform(0.001, 0.01) if kind == "wobble" else 10 ** rng.uniform(-4, -2.7)
    laws = rig.Laws(friction=None if kind == "roll" else rng.uniform(0.2, 0.5), slip_regularisation_m_s=1e-3,
                    rolling_friction_m=R * loss, pivoting_friction_m=R * loss, air_linear_N_m_s=air)
    top = rig.Rig(body, laws)
    start = top.state(rng.uniform(0, 2 * np.pi), theta, rng.uniform(0, 2 * np.pi), rate * rng.uniform(-0.12, 0.12),
                      W * s, w3 * rng.uniform(0.93, 1.07))
    if kind == "roll" and top.demand(start) > 0.8:
        return None
    run = rig.simulate(top, start, t_s, 1e-7)
    if len(run.t_s) < (0.4 if run.end == "flat" else 1.0) * len(t_s):
        return None
    phi, tilt, psi = run.euler()
    at, angles = run.y[:, :3], np.stack([phi, tilt, psi], axis=1)
    rest = len(t_s) - len(at)                                            # from "flat" on it lies where it fell
    if rest:
        lying = np.array([angles[-1, 0], 0.0, angles[-1, 2]])
        at = np.vstack([at, np.tile([at[-1, 0], at[-1, 1], h], (rest, 1))])
        angles = np.vstack([angles, np.tile(lying, (rest, 1))])
    return (kind, laws.__dict__), at, angles


def spin(rng, body, l_m, pivot_m, t_s):
    """A heavy top about a fixed point: angular momentum and axis in the world, spin by its own rate."""
    A, C = body.moments()
    I, theta = A + body.mass_kg * l_m**2, rng.uniform(0.2, 0.7)
    w3 = rng.choice([-1, 1]) * rng.uniform(2.2, 5) * 2 * np.sqrt(body.mass_kg * G * l_m * I) / C
    if abs(w3) > 300:
        return None
    phi, dphi = rng.uniform(0, 2 * np.pi), body.mass_kg * G * l_m / (C * w3) * rng.uniform(-2, 2.5)
    k = np.array([np.sin(theta) * np.sin(phi), -np.sin(theta) * np.cos(phi), np.cos(theta)])
    L = I * np.cross(k, np.cross(dphi * rig.Z, k)) + C * w3 * k
    weight = body.mass_kg * G * l_m

    def rate(_, y):
        k, L = y[:3], y[3:6]
        w = (L - (L @ k) * k) / I
        dphi = w[2] / (1 - k[2] ** 2)
        return np.concatenate([np.cross(w, k), weight * np.cross(rig.Z, k), [w3 - dphi * k[2]]])

    out = solve_ivp(rate, (t_s[0], t_s[-1]), np.concatenate([k, L, [rng.uniform(0, 6)]]), "DOP853", t_s, rtol=1e-10, atol=1e-12).y
    angles = np.stack([np.unwrap(np.arctan2(out[0], -out[1])), np.arccos(np.clip(out[2], -1, 1)), out[6]], axis=1)
    return ("top", {"w3_rad_s": w3}), np.array(pivot_m) + l_m * out[:3].T, angles


# --- Camera ----------------------------------------------------------------------------------------------------------
def place_camera(rng, target, height_m, tilt, f_px, size, distortion):
    turn, roll_ = rng.uniform(0, 2 * np.pi, 2)
    back = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    eye = target + back * height_m / np.cos(tilt)
    right = np.array([np.cos(roll_), np.sin(roll_), 0])
    right -= (right @ back) * back
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(-back, right), -back])
    w, h = size
    return {"width": w, "height": h, "fx": f_px, "fy": f_px, "cx": (w - 1) / 2 + rng.normal(0, 6), "cy": (h - 1) / 2 + rng.normal(0, 6),
            "dist_k1_k2_p1_p2_k3": [*distortion, 0.0, 0.0, 0.0], "R_world_to_cam": R.tolist(),
            "t_world_to_cam_m": (-R @ eye).tolist(), "camera_position_m": eye.tolist(),
            "exposure": "truth.csv is at mid-exposure of the row that shows the centre; t = frame/fps + readout_s row/(height-1)",
            "pixel_convention": "centre of the top-left pixel is (0,0); x right, y down"}


def project(camera, points):
    p = points @ np.array(camera["R_world_to_cam"]).T + np.array(camera["t_world_to_cam_m"])
    uv = p[:, :2] / p[:, 2:]
    k1, k2 = camera["dist_k1_k2_p1_p2_k3"][:2]
    r2 = (uv**2).sum(1, keepdims=True)
    return uv * (1 + r2 * (k1 + r2 * k2)) * [camera["fx"], camera["fy"]] + [camera["cx"], camera["cy"]]


def rim(body, at, angles, n=48):
    a = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.stack([body.radius_m * np.cos(a), body.radius_m * np.sin(a), 0 * a], axis=1)
    both = np.vstack([ring + [0, 0, body.thickness_m / 2], ring - [0, 0, body.thickness_m / 2]])
    return at + both @ rig.rotation(rig.quaternion(*angles)).T


# --- A clip ----------------------------------------------------------------------------------------------------------
def colour(rng, level, saturation):
    tint = rng.uniform(1 - saturation, 1, 3)
    return np.clip(level * tint / tint.mean(), 0.01, 0.93)


def draw(rng, readout=0.0):
    """Everything about one clip but its pictures; None where the draw cannot be filmed."""
    kind = rng.choice(["disc", "disc", "ring", "top"])
    R = np.exp(rng.uniform(np.log(0.01), np.log(0.05)))
    body = rig.Body(R, R * rng.uniform(0.08, 0.4), 0.0, R * rng.uniform(0.55, 0.88) if kind == "ring" else 0.0)
    body.mass_kg = rng.uniform(1000, 8000) * np.pi * (R**2 - body.inner_m**2) * body.thickness_m
    fps, frames, shutter = float(rng.choice([60, 100, 120, 200, 240])), int(rng.integers(90, 131)), rng.uniform(0.08, 0.55)
    rows = round(STEPS * readout / shutter)                              # poses from the first row's to the last's
    offsets = ((np.arange(STEPS + rows) + 0.5) / STEPS - 0.5) * shutter / fps
    of_frame = np.arange(frames)[:, None] / fps + offsets
    t_s, place = np.unique(of_frame.ravel() + 0.5 * shutter / fps, return_inverse=True)
    l_m, pivot = R * rng.uniform(0.9, 1.6), np.array([0, 0, R * rng.uniform(0.6, 1.2)])
    motion = spin(rng, body, l_m, pivot, t_s) if kind == "top" else roll(rng, body, t_s)
    if motion is None:
        return None
    law, at, angles = motion
    at, angles = (v[place.ravel()].reshape(*of_frame.shape, 3) for v in (at, angles))  # frame, pose, coordinate
    if kind != "top" and np.abs(np.diff(angles[:, 0, 0])).max() > 1.1:
        return None                                                      # precession near the Nyquist rate
    shift = np.append(-(at.max((0, 1)) + at.min((0, 1)))[:2] / 2, 0) * (kind != "top")
    at = at + shift
    reach = np.hypot(at[..., 0], at[..., 1]).max() + 1.3 * R
    size = [(640, 480), (720, 540), (800, 600), (960, 720)][rng.integers(4)]
    width_px = min(np.exp(rng.uniform(np.log(40), np.log(200))), 0.46 * size[1] * 2 * R / reach)
    height = max(rng.uniform(0.25, 1.3), 9 * R)
    if width_px < 40:
        return None
    f_px = width_px * height / (2 * R)
    corner = np.hypot(*size) / 2 / f_px
    k1 = rng.choice([0, rng.uniform(-0.25, 0.1)]) * min(1, 0.25 / corner**2)
    camera = place_camera(rng, np.array([0, 0, at[..., 2].mean() / 2]), height, rng.choice([0, rng.uniform(0, 0.35)]), f_px, size, [k1, 0.0])
    camera.update({"readout_s": rows / STEPS * shutter / fps} if rows else {}, fps=fps, shutter_fraction_of_frame=shutter, transfer=str(rng.choice(["sRGB", "sRGB", "sRGB", "linear"])))
    marked = rng.random() < 0.5 or kind == "top"
    marks = [{"kind": "dot", "r_m": R * 0.65, "radius_m": R * rng.uniform(0.13, 0.18), "angle_deg": 0,
              "faces": [1] if kind == "top" else [1, -1]}] if marked and kind != "ring" else []
    return dict(kind=kind, body=body, camera=camera, law=law, offsets=offsets, at=at, angles=angles, marks=marks, frames=frames,
                l_m=l_m, pivot=pivot)


def appearance(rng, clip):
    """Tracer keys of colours, lamps and floor."""
    R, H = clip["body"].radius_m, clip["camera"]["camera_position_m"][2]
    floor_level, sat = np.exp(rng.uniform(np.log(0.05), np.log(0.8))), rng.uniform(0, 0.5)
    while True:
        level = np.exp(rng.uniform(np.log(0.03), np.log(0.85)))
        face, floor = colour(rng, level, rng.uniform(0, 0.85)), colour(rng, floor_level, sat)
        if np.abs(np.log(face / floor)).max() > 0.3:
            break
    metal = rng.random() < 0.3
    keys = {"face": face * (0.3 if metal else 1), "wall": face * (0.3 if metal else rng.choice([1, rng.uniform(0.5, 1.3)])),
            "mirror": colour(rng, rng.uniform(0.3, 0.6), 0.25) if metal else rng.choice([0, 0.04]) * np.ones(3),
            "lobe": 10 ** rng.uniform(1.2, 2.6), "grain": rng.choice([0, rng.uniform(0.05, 0.5)]),
            "mark": np.full(3, 0.85 if face.mean() < 0.4 else 0.04), "floor": floor, "floor_kind": rng.integers(5),
            "floor_contrast": rng.uniform(0.05, 0.5), "floor_scale": rng.uniform(0.02, 0.15) * R, "floor_turn": rng.uniform(0, 6),
            "floor_sheen": rng.choice([0, 0, rng.uniform(0.3, 1)])}
    sky = colour(rng, 1.0, 0.15)
    keys["sky_up"], keys["sky_side"] = sky, sky * rng.uniform(0.4, 1.1)
    for i, strength in enumerate([rng.uniform(0.4, 5), rng.choice([0, rng.uniform(0.2, 1)])]):
        up, turn, far = rng.uniform(0.5, 1.4), rng.uniform(0, 6.3), H * rng.uniform(1.1, 2)
        n = np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
        u = np.cross(n, [0.3, 0.1, 1]); u /= np.linalg.norm(u)
        a, b = far * rng.uniform(0.04, 0.3, 2)
        power = strength * np.pi * far**2 / (4 * a * b * np.sin(up))       # its irradiance on the floor against the sky's
        keys[f"lamp{i}"] = np.concatenate([far * n, a * u, b * np.cross(n, u), power * colour(rng, 1, 0.1)])
    return keys


def tracer_scene(clip, look, seed, samples, path):
    body, camera, top = clip["body"], clip["camera"], clip["kind"] == "top"
    mark = clip["marks"][0] if clip["marks"] else {"r_m": 0, "radius_m": 0, "faces": []}
    keys = {k: camera[k] for k in ("width", "height", "fx", "fy", "cx", "cy")}
    keys |= {"samples": samples, "steps": len(clip["offsets"]), "row_steps": STEPS, "seed": seed, "k1": camera["dist_k1_k2_p1_p2_k3"][0], "k2": 0,
             "R": np.ravel(camera["R_world_to_cam"]), "eye": camera["camera_position_m"], "radius": body.radius_m,
             "inner_radius": body.inner_m, "half_thickness": body.thickness_m / 2, "axle_radius": 0.04 * body.radius_m * top,
             "axle_from": -clip["l_m"] * top, "axle_to": (body.thickness_m / 2 + 0.4 * body.radius_m) * top, "mark_at": mark["r_m"],
             "mark_radius": mark["radius_m"], "mark_angle": 0, "mark_up": int(1 in mark["faces"]), "mark_down": int(-1 in mark["faces"])}
    if top:
        keys["posts"] = [*clip["pivot"][:2], 0.1 * body.radius_m, clip["pivot"][2], 0.3, 0.3, 0.3]
    lines = [f"{k} " + " ".join(f"{x:.12g}" for x in np.atleast_1d(v)) for k, v in (keys | look).items()]
    path.write_text("\n".join(lines) + "\n")


def write_truth(clip, path):
    camera, read = clip["camera"], np.zeros(clip["frames"])               # when the row of the centre is
    moved, rows = np.concatenate([clip["at"], clip["angles"]], axis=2), ["frame,t,x_m,y_m,z_m,x_px,y_px,qw,qx,qy,qz,theta_rad,phi_rad,psi_rad,vis_frac"]
    for _ in range(8):
        pose = np.array([[np.interp(t, clip["offsets"], v) for v in m.T] for t, m in zip(read, moved)])
        at, angles, px = pose[:, :3], pose[:, 3:], project(camera, pose[:, :3])
        read = camera.get("readout_s", 0.0) * np.clip(px[:, 1] / (camera["height"] - 1), 0, 1)
    for i in range(clip["frames"]):
        q, outline = rig.quaternion(*angles[i]), project(camera, rim(clip["body"], at[i], angles[i]))
        seen = np.all((outline > 0) & (outline < [camera["width"] - 1, camera["height"] - 1]), axis=1).mean()
        numbers = [i / camera["fps"] + read[i], *at[i], *px[i], *q, angles[i][1], angles[i][0], angles[i][2], seen]
        rows.append(f"{i}," + ",".join(f"{x:.8f}" for x in numbers))
    path.write_text("\n".join(rows) + "\n")


def film(rng, clip, look, tracer, folder, seed, samples):
    camera = clip["camera"]
    w, h, fps = camera["width"], camera["height"], camera["fps"]
    tracer_scene(clip, look, seed, samples, folder / "scene.txt")
    np.array([[*p, *rig.quaternion(*a)] for p, a in zip(clip["at"].reshape(-1, 3), clip["angles"].reshape(-1, 3))]).tofile(folder / "poses.f64")
    sensor = {"psf_sigma_px": rng.uniform(0.35, 0.75), "read_noise_8bit": rng.uniform(0.4, 3.5),
              "shot_noise": rng.uniform(0, 0.012), "floor_level": np.clip(look["floor"].mean() * rng.uniform(0.7, 1.4), 0.04, 0.85),
              "gamma": 1.0 if camera["transfer"] == "linear" else 1 / rng.uniform(2.0, 2.4),
              "drift": rng.choice([0, rng.uniform(-0.08, 0.08)]), "crf": int(rng.integers(17, 24))}
    eyes = subprocess.Popen([tracer, folder / "scene.txt", folder / "poses.f64"], stdout=subprocess.PIPE)
    encode = ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{w}x{h}", "-r", f"{fps:g}", "-i", "-",
              "-c:v", "libx264", "-threads", "1", "-crf", str(sensor["crf"]), "-pix_fmt", "yuv420p", folder / "video.mp4"]
    file = subprocess.Popen(encode, stdin=subprocess.PIPE)
    gain = None
    for i in range(clip["frames"]):
        light = np.frombuffer(eyes.stdout.read(12 * w * h), np.float32)
        if light.size < 3 * w * h:
            break
        light = light.reshape(h, w, 3)
        gain = gain or sensor["floor_level"] / np.median(light)
        light = gaussian_filter(light, (sensor["psf_sigma_px"],) * 2 + (0,)) * gain * (1 + sensor["drift"] * i / clip["frames"])
        light = light + rng.normal(0, 1, light.shape) * sensor["shot_noise"] * np.sqrt(np.maximum(light, 0))
        coded = 255 * np.clip(light, 0, 1) ** sensor["gamma"] + rng.normal(0, sensor["read_noise_8bit"], light.shape)
        file.stdin.write(np.clip(np.rint(coded), 0, 255).astype(np.uint8).tobytes())
    file.stdin.close()
    if file.wait() or eyes.wait() or light.size < 3 * w * h:
        raise SystemExit(f"{folder}: tracer or ffmpeg failed")
    return sensor


def describe(clip, look, sensor, folder):
    body, plain = clip["body"], lambda v: v.tolist() if hasattr(v, "tolist") else v
    thing = {"type": "ring" if clip["kind"] == "ring" else "disc", "thickness_m": body.thickness_m, "mass_kg": body.mass_kg,
             "markers": clip["marks"],
             "dynamics": {"model": clip["law"][0], "parameters": {k: plain(v) for k, v in clip["law"][1].items()}}}
    thing |= {"R_outer_m": body.radius_m, "R_inner_m": body.inner_m} if body.inner_m else {"R_m": body.radius_m}
    if clip["kind"] == "top":
        thing |= {"com_to_pivot_m": clip["l_m"], "pivot_m": clip["pivot"].tolist(), "axle_radius_m": 0.04 * body.radius_m,
                  "axle_above_upper_face_m": 0.4 * body.radius_m}
    scene = {"look": {k: plain(v) for k, v in look.items()}, "sensor": sensor}
    for name, value in {"object": thing, "camera": clip["camera"], "scene": scene}.items():
        (folder / f"{name}.json").write_text(json.dumps(value, indent=1, default=plain))


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("out", type=Path)
    options.add_argument("lo", type=int)
    options.add_argument("hi", type=int)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--readout", type=float, default=0.0, help="rolling shutter: first row to last, of the frame interval")
    options.add_argument("--samples", type=int, default=32, help="rays per pixel")
    options.add_argument("--tracer", type=Path)
    o = options.parse_args()
    o.out.mkdir(parents=True, exist_ok=True)
    source = HERE / "tracer.cpp"
    tracer = (o.tracer or o.out.parent / "tracer").resolve()
    if not o.tracer and not (tracer.exists() and tracer.stat().st_mtime > source.stat().st_mtime):
        subprocess.run(["g++", "-std=c++20", "-O3", "-march=native", "-fopenmp", "-o", tracer, source], check=True)
    for number in range(o.lo, o.hi):
        rng = np.random.default_rng([o.seed, number])
        while (clip := draw(rng, o.readout)) is None:
            pass
        look, folder = appearance(rng, clip), o.out / f"{number:02d}"
        folder.mkdir(exist_ok=True)
        sensor = film(rng, clip, look, tracer, folder, number + 1, o.samples)
        write_truth(clip, folder / "truth.csv")
        describe(clip, look, sensor, folder)
        print(folder, clip["kind"], clip["law"][0], clip["frames"], flush=True)


if __name__ == "__main__":
    main()
