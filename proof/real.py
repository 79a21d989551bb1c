"""Known effects added to real recordings.

A background is a real recording, or every k-th pose of one. The plant is aligned to it: nominal arm, then the paper's
parameters, the tool's points and the measuring frame by Gauss-Newton. What an effect adds is the difference of two
evaluations of that plant, turned into the measuring frame, on top of what was measured. Whatever else the real arm does
stays in. Noise for lambda is the scatter that the program itself reports as held out on the recording without the
addition; what it says there is kept, since an effect that was already said is not found.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import shutil
import xml.etree.ElementTree as ET
import zlib
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

import configurations
import run
from curves import CURVES, REST_CURVE
from draws import log_uniform
from families import FAMILIES
from plant import DEG, MM, Arm, Session, simulate, triangle
from visible import Design, Invisible, context, jacobian, parameters, survey

HERE = Path(__file__).resolve().parent
CACHE = HERE / "runs" / "backgrounds"
# recording, and which of its poses: every k-th from the m-th
BACKGROUNDS = {
    "irb120": ("irb120/tracker.csv", 1, 0),
    "irb120.1": ("irb120/tracker.csv", 3, 0),
    "irb120.2": ("irb120/tracker.csv", 3, 1),
    "irb120.3": ("irb120/tracker.csv", 3, 2),
    "ur10.random": ("ur10/random.csv", 3, 0),
    "ur10.random.2": ("ur10/random.csv", 2, 1),
    "ur10.configurations": ("ur10/configurations.csv", 2, 0),
    "kuka_rail": ("kuka_rail/rail.csv", 1, 0),
    "iiwa7": ("iiwa7/20161118_run_1.csv", 1, 0),
}
# in turn; whole recordings cost minutes each
USUAL = ["irb120.1", "ur10.random", "irb120.2", "kuka_rail", "irb120.3", "iiwa7", "irb120.1", "irb120.2"]


def data() -> Path | None:
    """Where the shared recordings are; they are no part of the repository."""
    return next((p for n in (1, 2) if (p := HERE.parents[n] / "shared" / "data").is_dir()), None)


# ---- arms ------------------------------------------------------------------------------------------------------------


def arm_of(folder: Path) -> Arm:
    """The nominal arm of a folder with robot.toml or robot.urdf, and cell.toml. Without masses there are no torques."""
    import tomllib  # Python 3.10 has none

    cell = cell_of(folder)
    tool, balls = cell["tool"], cell.get("balls", {})
    if (folder / "robot.toml").is_file():
        robot = tomllib.loads((folder / "robot.toml").read_text())["joint"]
        of = lambda key: np.array([j[key] for j in robot], float)  # noqa: E731
        chain = dict(alpha=of("alpha_deg") * DEG, a=of("a_mm") * MM, d=of("d_mm") * MM, mass=of("mass_kg"))
        chain |= dict(offset=of("theta_offset_deg") * DEG, limits=of("limits_deg") * DEG, cog=of("cog_mm") * MM)
    else:
        chain = modified_dh(*urdf_axes(folder / "robot.urdf"))
    weighty = bool(chain["mass"].any())
    arm = Arm(
        **chain,
        base_xyz=np.array(cell["base"]["xyz_mm"]) * MM,
        base_zyx=np.array(cell["base"]["zyx_deg"]) * DEG,
        tcp=np.array(tool["tcp_mm"]) * MM,
        tool_mass=float(tool.get("mass_kg", 0.0)) if weighty else 0.0,
        tool_cog=np.array(tool.get("cog_mm", [0.0] * 3)) * MM,
        balls=triangle(*(np.array([d[k] for k in ("d12", "d13", "d23")]) * MM))
        if (d := balls.get("distances_mm"))
        else np.array(balls.get("positions_mm", [])).reshape(-1, 3) * MM,
        compliance=np.zeros(len(chain["alpha"])),
        name=folder.name,
    )
    return arm.but(weight=max(1.0, float(arm.mass.sum()) / 12.0)) if weighty else arm


def cell_of(folder: Path) -> dict:
    import tomllib

    return tomllib.loads((folder / "cell.toml").read_text())


def urdf_axes(path: Path) -> tuple[np.ndarray, np.ndarray, tuple[bool, ...], np.ndarray]:
    """Axes (J, 3) and points on them (J, 3) m at zero, which joints slide, limits; origins without rpy only."""
    at, axes, points, slides, limits = np.zeros(3), [], [], [], []
    for joint in ET.parse(path).getroot().iter("joint"):
        origin = joint.find("origin").attrib
        if any(float(x) for x in origin.get("rpy", "0 0 0").split()):
            raise ValueError(f"{path}: joint {joint.get('name')} has an rpy")
        at = at + np.array([float(x) for x in origin["xyz"].split()])
        if joint.get("type") == "fixed":
            continue
        axes.append([float(x) for x in joint.find("axis").get("xyz").split()])
        points.append(at)
        slides.append(joint.get("type") == "prismatic")
        limits.append([float(joint.find("limit").get(key)) for key in ("lower", "upper")])
    return np.array(axes), np.array(points), tuple(slides), np.array(limits)


def modified_dh(z: np.ndarray, p: np.ndarray, slides: tuple[bool, ...], limits: np.ndarray) -> dict:
    """Craig's parameters of a chain of axes: {j} stands where the common normal to the next axis leaves axis j.

    {0} is {1} at zero, and the last frame has the direction of the one before where it can: base and tool are fitted.
    """
    n = len(z)
    x, o = np.empty((n, 3)), np.array(p)
    for j in range(n):
        if j + 1 < n:
            across, between = np.cross(z[j], z[j + 1]), p[j + 1] - o[j]
            if np.linalg.norm(across) > 1e-9:
                # o + s z_j + k across + u z_next = p_next
                s, k, _ = np.linalg.solve(np.stack([z[j], across, z[j + 1]], 1), between)
                o[j] = o[j] + s * z[j]
                x[j] = across * (np.sign(k) or 1.0) if abs(k) > 1e-9 else across
            else:
                x[j] = between - z[j] * (z[j] @ between)
        if j + 1 == n or np.linalg.norm(x[j]) < 1e-9:
            x[j] = x[j - 1] - z[j] * (z[j] @ x[j - 1]) if j else np.eye(3)[np.argmin(np.abs(z[j]))]
            if np.linalg.norm(x[j]) < 1e-9:
                x[j] = np.cross(z[j], z[j - 1])
        x[j] /= np.linalg.norm(x[j])

    def angle(a, b, about):
        return float(np.arctan2(np.cross(a, b) @ about, a @ b))

    alpha, a, d, offset = (np.zeros(n) for _ in range(4))
    for j in range(1, n):
        alpha[j], a[j] = angle(z[j - 1], z[j], x[j - 1]), float((o[j] - o[j - 1]) @ x[j - 1])
        d[j], offset[j] = float((o[j] - o[j - 1]) @ z[j]), angle(x[j - 1], x[j], z[j])
        if slides[j]:
            raise ValueError("only the first joint may slide")
    nothing = dict(mass=np.zeros(n), cog=np.zeros((n, 3)))
    return dict(alpha=alpha, a=a, d=d, offset=offset, limits=limits, slides=slides, **nothing)


# ---- recordings ------------------------------------------------------------------------------------------------------


@dataclass
class Real:
    """A background: its text, and the plant aligned to it. `rows` are those that measure the tool."""

    name: str
    folder: Path
    columns: list[str]
    text: list[list[str]]
    rows: np.ndarray
    arm: Arm
    s: Session
    measuring_from_world: tuple[np.ndarray, np.ndarray]
    rms: float  # m, what the aligned plant leaves

    def csv(self, text: list[list[str]] | None = None) -> str:
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerows([self.columns, *(self.text if text is None else text)])
        return out.getvalue()

    def files(self, recording: str) -> dict[str, str]:
        robot = next(self.folder.glob("robot.*"))
        cell = (self.folder / "cell.toml").read_text()
        return {robot.name: robot.read_text(), "cell.toml": cell, "recording.csv": recording}


@lru_cache(maxsize=4)
def load(name: str) -> Real:
    file, every, start = BACKGROUNDS[name]
    root = data()
    if root is None:
        raise SystemExit("real backgrounds need the shared recordings")
    columns, text = rows_of(root / file)
    poses = {seq: i for i, seq in enumerate(dict.fromkeys(r[columns.index("seq")] for r in text))}
    text = [r for r in text if poses[r[columns.index("seq")]] % every == start]
    # measured torques are left out: elastic effects here are of torques that the plant computes
    kept = [i for i, c in enumerate(columns) if not c.startswith("tau")]
    columns, text = [columns[i] for i in kept], [[r[i] for i in kept] for r in text]
    folder = (root / file).parent
    arm, s, measured, rows = parsed(folder, columns, text)
    arm, s, where, rest = aligned(arm, s, measured)
    rms = float(np.sqrt(np.mean(np.sum(rest**2, 1))))
    return Real(name, folder, columns, text, rows, giving_way(arm, s), s, where, rms)


def rows_of(path: Path) -> tuple[list[str], list[list[str]]]:
    with open(path) as f:
        columns, *text = csv.reader(f)
    return columns, text


def parsed(
    folder: Path, columns: list[str], text: list[list[str]], prefer: tuple[str, ...] = ("qc", "q")
) -> tuple[Arm, Session, np.ndarray, np.ndarray]:
    """Nominal arm, what is known of the rows that measure the tool, measured points (N, 3) m, and which rows these
    are. `prefer`: on a real arm the tool is where the joints were sent to rather than where they were read."""
    arm = arm_of(folder)
    measures = [not (("reference" in columns) and r[columns.index("reference")]) for r in text]
    rows = np.flatnonzero(measures)

    def column(c: str, otherwise: float = 0.0) -> np.ndarray:
        if c not in columns:
            return np.full(len(rows), otherwise)
        k = columns.index(c)
        return np.array([float(text[i][k]) for i in rows])

    joints = range(1, len(arm.alpha) + 1)

    def angles(*names: str) -> np.ndarray:
        units = {"deg": DEG, "mm": MM}
        kept = [next(c for x in names for u in units if (c := f"{x}{j}_{u}") in columns) for j in joints]
        return np.stack([column(c) * units[c.split("_")[1]] for c in kept], 1)

    q = angles(*prefer)
    point = None
    if "target" in columns:
        targets = np.array(cell_of(folder)["tool"]["targets_mm"]) * MM
        point = (targets - arm.tcp)[column("target").astype(int) - 1]
    touch = "ball" in columns
    order = column("seq") if "seq" in columns else np.arange(len(rows))
    measured = np.stack([column(f"{'i' * touch}{a}_mm") for a in "xyz"], 1) * MM
    s = Session(
        touch=touch,
        q=q,
        t=column("t_s") if "t_s" in columns else 12.0 * (order - order[0]),
        temp=column("temp_c", 20.0),
        dirs=np.stack([column(f"dir{j}") for j in joints], 1),
        ball=np.maximum(column("ball").astype(int) - 1, 0),
        sigma=1e-4,
        spread=float(np.abs(measured).mean()) if touch else 0.0,
        lag=angles("qc", "q") - angles("q"),
        rest=np.zeros_like(q),
        has_commanded="qc1_deg" in columns,
        has_thermometer="temp_c" in columns,
        load=column("payload_kg") if "payload_kg" in columns else None,
        reading=measured if touch else None,
        point=point,
    )
    return arm, s, measured, rows


def rigid(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R, o with R a + o nearest to b, points (N, 3)."""
    u, _, vt = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    r = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return r, b.mean(0) - r @ a.mean(0)


def moved(arm: Arm, s: Session, step: np.ndarray) -> tuple[Arm, Session]:
    """Arm and tool points after a step in the columns of `visible.jacobian` (without a tracker's frame)."""
    moves = [m for m in parameters(arm) if s.touch or not m[0].startswith("base")]
    new = {}
    for name in ("base_xyz", "base_zyx", "tcp", "alpha", "a", "d", "offset", "compliance"):
        new[name] = getattr(arm, name) + sum(
            x * (getattr(above, name) - getattr(below, name)) / (2 * h)
            for x, (_, below, above, h) in zip(step, moves, strict=False)
        )
    if s.point is not None:
        points, ids = np.unique(s.point, axis=0, return_inverse=True)
        points[1:] += step[len(moves) : len(moves) + 3 * (len(points) - 1)].reshape(-1, 3)
        s = replace(s, point=points[ids.ravel()])
    return arm.but(**new), s


def aligned(arm: Arm, s: Session, measured: np.ndarray, steps: int = 4):
    """The paper's parameters, tool points and frame fitted to a recording; `measured` (N, 3) m are points in the
    measuring frame, or readings. Returns arm, session, measuring_from_world, and residuals (N, 3) m in the world, gross
    errors set to zero."""
    where = np.eye(3), np.zeros(3)
    for k in range(steps + 1):
        poses = simulate(arm, s)
        if s.touch:
            rest = poses.ball - poses.tcp - np.einsum("nij,nj->ni", poses.r, measured)
        else:
            where = rigid(poses.tcp, measured)
            rest = (measured - where[1]) @ where[0] - poses.tcp
        far = np.linalg.norm(rest, axis=1)
        near = far < 6 * np.median(far)
        if k == steps:
            break
        jac = jacobian(arm, s)
        size = np.maximum(np.linalg.norm(jac, axis=0), 1e-12)
        keep = np.repeat(near, 3)
        # Tikhonov's: parameters that the poses do not show stay where they are
        scaled, y = jac[keep] / size, rest.ravel()[keep]
        step = np.linalg.solve(scaled.T @ scaled + 1e-7 * np.eye(len(size)), scaled.T @ y) / size
        arm, s = moved(arm, s, step)
    return arm, s, where, np.where(near[:, None], rest, 0.0)


def giving_way(arm: Arm, s: Session) -> Arm:
    """The arm with compliances that effects of torque can act on, and in units of the IRB 120's torques."""
    tau = np.abs(simulate(arm, s).machine.tau).max(0)
    if not tau.any():
        return arm
    arm = arm.but(pull=max(1.0, float(tau.max()) / 15.0))
    # a joint may seem to be lifted by its load where something else acts
    usual = 2e-3 * DEG / arm.pull
    return arm.but(compliance=np.where(tau > 1e-9, np.maximum(arm.compliance, usual), 0.0))


def displaced(real: Real, s: Session, effects: list[dict]) -> list[list[str]]:
    """The background's rows with what the effects add."""
    r, _ = real.measuring_from_world
    without, with_ = simulate(real.arm, s), simulate(real.arm, s, effects)
    frame = with_.machine.frame
    moved = np.zeros((len(real.text), 3))
    moved[:] = np.stack([np.interp(np.arange(len(moved)), real.rows, frame[:, k]) for k in range(3)], 1)
    moved[real.rows] = (with_.tcp - without.tcp) @ r.T + frame
    turn = r @ with_.r @ np.swapaxes(without.r, 1, 2) @ r.T
    half = 0.25 * np.stack([turn[:, i, j] - turn[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], 1)
    half_turn = dict(zip(real.rows, half, strict=True))
    at = {c: i for i, c in enumerate(real.columns)}
    out = [list(row) for row in real.text]
    for i, row in enumerate(out):
        for k, a in enumerate("xyz"):
            row[at[f"{a}_mm"]] = f"{float(row[at[f'{a}_mm']]) + moved[i, k] / MM:.6f}"
        if "qw" in at and i in half_turn:
            w, v = float(row[at["qw"]]), np.array([float(row[at[f"q{a}"]]) for a in "xyz"])
            h = half_turn[i]
            turned = np.append(w - h @ v, v + w * h + np.cross(h, v))
            turned /= np.linalg.norm(turned)
            for name, x in zip(("qw", "qx", "qy", "qz"), turned, strict=True):
                row[at[name]] = f"{x:.9f}"
    return out


# ---- what is said without an addition --------------------------------------------------------------------------------


def answer_without(binary: Path, folder: Path, timeout: float = 900.0) -> dict:
    """What the program says of a background, asked once."""
    digest = hashlib.sha256(binary.read_bytes())
    for f in sorted(folder.iterdir()):
        digest.update(f.name.encode() + f.read_bytes())
    kept = CACHE / f"{digest.hexdigest()[:24]}.json"
    if not kept.is_file():
        CACHE.mkdir(parents=True, exist_ok=True)
        said = run.diagnose(binary, folder, timeout)
        if said["answer"] is None:
            return said
        kept.write_text(json.dumps(said))
    return json.loads(kept.read_text())


def write_background(name: str, out: Path) -> Path:
    folder = out / "backgrounds" / name
    if not folder.is_dir():
        real = load(name)
        folder.mkdir(parents=True)
        for file, text in real.files(real.csv()).items():
            (folder / file).write_text(text)
    return folder


def answers_without(binary: Path, out: Path) -> None:
    """Leaves what is said of each background of a set of cases beside them."""
    where = out / "without"
    shutil.rmtree(where, ignore_errors=True)
    where.mkdir()
    for folder in sorted((out / "backgrounds").iterdir()):
        (where / f"{folder.name}.json").write_text(json.dumps(answer_without(binary, folder)))


# ---- cases -----------------------------------------------------------------------------------------------------------


def beside(design: Design, effect: dict, findings: list[dict]) -> float:
    """lambda of an effect beside what is said of its background without it.

    `sqrt(s' (I + B B')^-1 s)` for the effect's signature `s` and the signatures `B` of what is said, each at the large
    end of its typical sizes, as if that were the standard deviation of its size.
    """
    families = {**FAMILIES, "encoder_error": REST_CURVE}
    ctx = context(design.arm, design.s)
    columns = []
    for f in findings:
        family = families.get(f["effect"])
        if family and family.span and f["site"] in family.sites(ctx):
            columns += design.columns(f["effect"], f["site"], family.span(ctx, f["site"]))
    s = design.project(design.signature([effect])) / design.s.sigma
    b = np.concatenate([np.zeros((len(s), 0)), *columns], axis=1)
    bs = b.T @ s
    return float(np.sqrt(max(s @ s - bs @ np.linalg.solve(np.eye(b.shape[1]) + b.T @ b, bs), 0.0)))


def make_case(name: str, said: dict, seed: int, index: int) -> tuple[str, dict[str, str], dict]:
    """Id, files, truth of one effect added to a background of which the program says `said`.

    What is said of it already is not added: the recording would have the sum of the two, whose size nobody knows (a
    twist was once taken out again to a twentieth), and the name without the addition.
    """
    import make

    real = load(name)
    there = [f for f in said["findings"] if f["family_confidence"] >= 0.5]
    final = said["final"]
    scatter = (final.get("holdout_rms_mm") or final["rms_mm"]) * MM / np.sqrt(3)
    for attempt in range(20):
        rng = np.random.default_rng([seed, zlib.crc32(b"real"), index, attempt])
        s = replace(real.s, sigma=scatter)
        if not s.has_thermometer:
            s = replace(s, temp=configurations.warm_up(rng, s.t - s.t[0]))
        families = {**FAMILIES, "encoder_error": CURVES["encoder_error"][1]}
        families = {k: f for k, f in families.items() if f.tracker and k != "late_joint_reading"}
        if "reference" in real.columns:  # fixed points take the frame's own motion out
            del families["frame_drift"]
        if s.rise.max() < 0.3:
            families = {k: f for k, f in families.items() if not k.startswith("thermal")}
        design = Design(real.arm, s)
        # from what is just visible to what is plain: sizes that are drawn too small are drawn again
        want = log_uniform(rng, 6.0, 20.0)
        try:
            effect, s, _ = make.draw_effect(rng, real.arm, s, design, families, want, there)
            break
        except Invisible:
            continue
    else:
        raise Invisible(f"{name}: nothing can be seen on it")
    _, alike = survey(design, [effect])
    sizes = {
        "lambda": round(design.lam([effect]), 3),
        "lambda_apart": round(beside(design, effect, there), 3),
    }
    truth = {
        "kind": "real",
        "background": name,
        "scatter_mm": scatter / MM,
        "aligned_rms_mm": real.rms / MM,
        "tool_mass": real.arm.tool_mass,
        "measurements": len(s.q),
        "poses": len({tuple(x) for x in s.q}),
        "span": float(s.t[-1] - s.t[0]) / 12.0,
        "rise_k": float(s.rise.max()) if s.has_thermometer else None,
        "touch": False,
        "sigma_mm": scatter / MM,
        "noise": "real",
        "rows": {},
        "session": {},
        "effects": [{**effect, **sizes, "alike": alike[0]}],
        "unseen": [],
    }
    return make.name_of("real", seed, index), real.files(real.csv(displaced(real, s, [effect]))), truth
