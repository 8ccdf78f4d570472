"""Discs and rings on a floor, simulated a second time.

World-frame Newton-Euler equations of a body of finite thickness that touches the floor with its lower rim. Attitude is a
quaternion, accelerations and contact force come from one linear system per instant, with the contact's constraint written
at acceleration level. Nothing here is taken from the project's model, which works in node axes with eliminated forces:
what both agree on was derived twice. Needs numpy and scipy. SI units; z up, floor at z = 0.
"""
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

Z = np.array([0.0, 0.0, 1.0])
EXACT_SLIP_M_S = 1e-6   # slower than this a point counts as at rest under the exact Coulomb law
FLAT_RAD = 0.02         # tilt at which a run ends: the face is about to touch


@dataclass
class Body:
    """Uniform disc (inner_m = 0) or ring; thickness_m is the whole height along the axis."""
    radius_m: float
    thickness_m: float
    mass_kg: float
    inner_m: float = 0.0

    def moments(self):
        """Transverse and axial moment about the centre of mass [kg m^2]."""
        square = self.radius_m**2 + self.inner_m**2
        return self.mass_kg * (3 * square + self.thickness_m**2) / 12, self.mass_kg * square / 2


@dataclass
class Laws:
    """What acts besides gravity and the normal force. friction None: rolls whatever it takes; 0: smooth floor."""
    friction: float | None = None
    slip_regularisation_m_s: float = 0.0     # 0: exact Coulomb law, rolling and sliding in turn
    rolling_friction_m: float = 0.0          # couple against the horizontal angular velocity, per normal force
    pivoting_friction_m: float = 0.0         # against the vertical one
    contour_friction_m: float = 0.0          # against the contact's run along the rim
    air_linear_N_m_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    air_quadratic_N_m_s2: np.ndarray = field(default_factory=lambda: np.zeros(3))
    air_force_N_s_m: float = 0.0
    couple_regularisation_rad_s: float = 0.01
    gravity_m_s2: float = 9.81
    slope: tuple[float, float] = (0.0, 0.0)  # rise of the floor per length along x and y, the axes of which lie in it

    def weight_m_s2(self):
        down = -np.array([*self.slope, 1.0])
        return self.gravity_m_s2 * down / np.sqrt(down @ down)


def rotation(q):
    """Matrix body -> world of a quaternion (w, x, y, z) of any length."""
    w, x, y, z = q / np.sqrt(q @ q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def quaternion(phi, theta, psi):
    """Attitude Rz(phi) Rx(theta) Rz(psi)."""
    half, c, s = (phi + psi) / 2, np.cos(theta / 2), np.sin(theta / 2)
    return np.array([c * np.cos(half), s * np.cos((phi - psi) / 2), s * np.sin((phi - psi) / 2), c * np.sin(half)])


def cross(a, b):
    """numpy's own is ten times slower on single vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


class Rig:
    """State y = (position 3, velocity 3, quaternion 4, angular velocity 3), all in world axes."""

    def __init__(self, body, laws):
        self.body, self.laws = body, laws

    def axes(self, y):
        """Node line, steepest ascent in the body's plane, symmetry axis; cosine and sine of the tilt."""
        w, a, b, c = y[6:10] / np.sqrt(y[6:10] @ y[6:10])
        k = np.array([2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b)])
        cos = k[2]
        sin = np.sqrt(max(1 - cos * cos, 1e-300))
        e2 = (Z - cos * k) / sin
        return cross(e2, k), e2, k, cos, sin

    def contact(self, y):
        """Vector from the centre of mass to the lowest point and its rate of change."""
        _, e2, k, cos, sin = self.axes(y)
        w, side = y[10:13], np.sign(cos)
        k_rate = cross(w, k)
        up = -k_rate[2] * k - cos * k_rate
        e2_rate = (up - e2 * (e2 @ up)) / sin
        R, h = self.body.radius_m, side * self.body.thickness_m / 2
        return -R * e2 - h * k, -R * e2_rate - h * k_rate

    def slip(self, y):
        """Velocity of the body's point at the contact."""
        return y[3:6] + cross(y[10:13], self.contact(y)[0])

    def couples(self, y):
        """Couple of the air, and of the contact per unit of normal force."""
        n, e2, k, cos, sin = self.axes(y)
        w, laws = y[10:13], self.laws
        eps = laws.couple_regularisation_rad_s
        node = np.array([w @ n, w @ e2, w @ k])
        c = np.asarray(laws.air_linear_N_m_s) + np.asarray(laws.air_quadratic_N_m_s2) * np.sqrt(w @ w)
        air = -(c[0] * node[0] * n + c[1] * node[1] * e2 + c[2] * node[2] * k)
        level = np.array([w[0], w[1], 0.0])
        run = node[2] - node[1] * cos / sin
        contact = (-laws.pivoting_friction_m * w[2] / np.hypot(w[2], eps) * Z
                   - laws.rolling_friction_m * level / np.sqrt(level @ level + eps * eps)
                   + laws.contour_friction_m * run / np.hypot(run, eps) * (cos / sin * e2 - k))
        return air, contact

    def accelerations(self, y, rolling):
        """Linear and angular acceleration and the contact force: Newton, Euler and the constraint in one system."""
        m, (A, C) = self.body.mass_kg, self.body.moments()
        k, w, v = self.axes(y)[2], y[10:13], y[3:6]
        inertia = A * np.eye(3) + (C - A) * np.outer(k, k)
        r, r_rate = self.contact(y)
        air, contact = self.couples(y)
        M, b = np.zeros((9, 9)), np.zeros(9)
        M[0:3, 0:3], M[0:3, 6:9] = m * np.eye(3), -np.eye(3)
        b[0:3] = m * self.laws.weight_m_s2() - self.laws.air_force_N_s_m * v
        M[3:6, 3:6], M[3:6, 6:9] = inertia, -skew(r)
        M[3:6, 8] -= contact
        b[3:6] = air - cross(w, inertia @ w)
        held = slice(0, 3) if rolling else slice(2, 3)      # which components of the point's acceleration vanish
        rows = slice(6, 9) if rolling else slice(8, 9)
        M[rows, 0:3], M[rows, 3:6] = np.eye(3)[held], -skew(r)[held]
        b[rows] = -cross(w, r_rate)[held]
        if not rolling:                                     # sliding friction opposes the point's velocity
            u = y[3:6] + cross(w, r)
            ratio = -(self.laws.friction or 0.0) / np.sqrt(u[:2] @ u[:2] + self.laws.slip_regularisation_m_s**2 + 1e-30)
            M[6:8, 6:8] = np.eye(2)
            M[6:8, 8] = -ratio * u[:2]
        solution = np.linalg.solve(M, b)
        return solution[0:3], solution[3:6], solution[6:9]

    def derivative(self, y, rolling):
        a, alpha, _ = self.accelerations(y, rolling)
        w, q = y[10:13], y[6:10]
        q_rate = 0.5 * np.concatenate(([-w @ q[1:]], q[0] * w + cross(w, q[1:])))
        return np.concatenate((y[3:6], a, q_rate, alpha))

    def demand(self, y):
        """Friction that rolling asks for, per unit of normal force."""
        F = self.accelerations(y, True)[2]
        return np.hypot(F[0], F[1]) / F[2]

    def energy(self, y):
        A, C = self.body.moments()
        w, k = y[10:13], self.axes(y)[2]
        spin = w @ k
        return (0.5 * self.body.mass_kg * y[3:6] @ y[3:6] + 0.5 * A * (w @ w - spin * spin) + 0.5 * C * spin * spin
                - self.body.mass_kg * self.laws.weight_m_s2() @ y[0:3])

    def power(self, y, rolling):
        """Rate at which the energy must change [W]."""
        air, contact = self.couples(y)
        F = self.accelerations(y, rolling)[2]
        lost = air @ y[10:13] + F[2] * (contact @ y[10:13]) - self.laws.air_force_N_s_m * (y[3:6] @ y[3:6])
        return lost if rolling else lost + F @ self.slip(y)

    def state(self, phi, theta, psi, w1, w2, w3, x=0.0, y=0.0, velocity=None):
        """Start from Euler angles and node-axes rates; velocity (x, y) or None to roll."""
        out = np.zeros(13)
        out[6:10] = quaternion(phi, theta, psi)
        n, e2, k, _, _ = self.axes(out)
        out[10:13] = w1 * n + w2 * e2 + w3 * k
        r = self.contact(out)[0]
        out[0:3] = x, y, -r[2]
        out[3:6] = -cross(out[10:13], r)
        if velocity is not None:
            out[3:5] = velocity
        return out

    def rolled(self, y):
        """The same with the velocity that rolling asks for."""
        return np.concatenate((y[:3], -cross(y[10:13], self.contact(y)[0]), y[6:]))


@dataclass
class Run:
    """States at the times asked for, as far as the run went; switches are (time, rolling from then on)."""
    t_s: np.ndarray
    y: np.ndarray
    switches: list
    end: str

    def position(self):
        return self.y[:, 0:3]

    def matrices(self):
        return np.array([rotation(q) for q in self.y[:, 6:10]])

    def euler(self):
        """phi, theta, psi, unwrapped."""
        M = self.matrices()
        phi = np.unwrap(np.arctan2(M[:, 0, 2], -M[:, 1, 2]))
        return phi, np.arccos(np.clip(M[:, 2, 2], -1, 1)), np.unwrap(np.arctan2(M[:, 2, 0], M[:, 2, 1]))

    def rolling(self):
        """Per sample: does it roll?"""
        at, mode = zip(*self.switches)
        return np.array(mode)[np.searchsorted(at, self.t_s, side="right") - 1]


def simulate(rig, start, t_s, rtol=1e-9):
    """Integrate from t_s[0] to the last time, switching between rolling and sliding where the exact law says so."""
    laws, exact = rig.laws, rig.laws.slip_regularisation_m_s == 0
    limit = laws.friction
    slipping = np.linalg.norm(rig.slip(start)[:2]) > EXACT_SLIP_M_S
    rolling = limit is None or (exact and limit > 0 and not slipping and rig.demand(start) <= limit)
    now, y, pieces, switches, end = t_s[0], start, [], [(t_s[0], rolling)], "reached the end"
    while now < t_s[-1] and end == "reached the end":
        stops = [lambda t, y: rig.axes(y)[4] - np.sin(FLAT_RAD), lambda t, y: abs(rig.axes(y)[3]) - 1e-3,
                 lambda t, y, m=rolling: rig.accelerations(y, m)[2][2] / rig.body.mass_kg]
        names = ["flat", "rim switch", "lift-off"]
        if rolling and limit is not None:
            stops.append(lambda t, y: limit - rig.demand(y))
        if not rolling and exact and limit:
            stops.append(lambda t, y: np.linalg.norm(rig.slip(y)[:2]) - EXACT_SLIP_M_S)
        for stop in stops:
            stop.terminal, stop.direction = True, -1
        part = solve_ivp(lambda t, y, m=rolling: rig.derivative(y, m), (now, t_s[-1]), y, events=stops, rtol=rtol,
                         atol=1e-11, method="DOP853" if rolling or not limit else "LSODA", dense_output=True)
        inside = (t_s >= now) & (t_s <= part.t[-1]) if not pieces else (t_s > now) & (t_s <= part.t[-1])
        if inside.any():
            pieces.append(part.sol(t_s[inside]).T)
        now, y = part.t[-1], part.y[:, -1]
        if part.status < 0:
            end = part.message
        elif part.status == 1:
            hit = next(i for i, found in enumerate(part.t_events) if len(found))
            if hit < 3:
                end = names[hit]
                break
            rolling = not rolling
            if rolling and rig.demand(rig.rolled(y)) > limit:
                rolling = False                             # passes through rest without staying
            y = rig.rolled(y)
            if not rolling:                                 # let the contact creep the way rolling could not hold
                F = rig.accelerations(y, True)[2]
                y[3:5] -= 0.1 * EXACT_SLIP_M_S * F[:2] / np.linalg.norm(F[:2])
            switches.append((now, rolling))
    states = np.concatenate(pieces)
    return Run(t_s[:len(states)], states, switches, end)
