//! Rust peers on the tasks in a folder: `rust-peers FOLDER [row ...]`, one JSON object a line, CPU time as everywhere.
use std::hint::black_box;

use nix::time::{ClockId, clock_gettime};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::SharedShape;
use rs_opw_kinematics::constraints::Constraints;
use rs_opw_kinematics::kinematic_traits::Kinematics;
use rs_opw_kinematics::kinematics_impl::OPWKinematics;
use rs_opw_kinematics::parameters::opw_kinematics::Parameters;

const PI: f64 = std::f64::consts::PI;
/// alpha, a, d, offset, as in `arm.py`.
const MDH: [[f64; 4]; 6] = [
    [0.0, 0.0, 0.290, 0.0],
    [-PI / 2.0, 0.0, 0.0, -PI / 2.0],
    [0.0, 0.270, 0.0, 0.0],
    [-PI / 2.0, 0.070, 0.302, 0.0],
    [PI / 2.0, 0.0, 0.0, 0.0],
    [-PI / 2.0, 0.0, 0.072, PI],
];
const LIMITS: [[f64; 2]; 6] =
    [[-165.0, 165.0], [-110.0, 110.0], [-110.0, 70.0], [-160.0, 160.0], [-120.0, 120.0], [-180.0, 180.0]];

fn cpu() -> f64 {
    let t = clock_gettime(ClockId::CLOCK_PROCESS_CPUTIME_ID).unwrap();
    t.tv_sec() as f64 + 1e-9 * t.tv_nsec() as f64
}

/// Median CPU time of a call over 9 batches of at least 50 ms, s.
fn time<T>(mut f: impl FnMut(usize) -> T) -> f64 {
    let (mut count, mut k) = (1, 0);
    let mut batch = |count: usize| {
        let start = cpu();
        for _ in 0..count {
            k += 1;
            black_box(f(k));
        }
        (cpu() - start) / count as f64
    };
    batch(1);
    while batch(count) * (count as f64) < 0.05 {
        count *= 2;
    }
    let mut all: Vec<f64> = (0..9).map(|_| batch(count)).collect();
    all.sort_by(f64::total_cmp);
    all[4]
}

fn report(row: &str, who: &str, version: &str, seconds: f64, accuracy: &str) {
    println!(
        r#"{{"row": "{row}", "who": "{who}", "version": "{version}", "seconds": {seconds:e}, "accuracy": "{accuracy}"}}"#
    );
}

struct Task {
    folder: String,
    rows: Vec<String>,
    joints: Vec<[f64; 6]>,
}

impl Task {
    fn wants(&self, row: &str) -> bool {
        self.rows.is_empty() || self.rows.iter().any(|r| r == row)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(format!("{}/{name}", self.folder)).unwrap()
    }
}

fn main() {
    let mut args = std::env::args().skip(1);
    let mut task = Task { folder: args.next().unwrap(), rows: args.collect(), joints: Vec::new() };
    let row = |line: &str| -> Vec<f64> { line.split_whitespace().map(|x| x.parse().unwrap()).collect() };
    task.joints = task.read("joints.txt").lines().map(|l| row(l).try_into().unwrap()).collect();
    openrr_k(&task);
    opw(&task);
    ik_geo_crate(&task);
    for kind in ["capsule", "box", "hull"] {
        collision(&task, kind);
    }
}

/// The arm as a URDF, for `k`.
fn urdf() -> String {
    use k::nalgebra::{UnitQuaternion, Vector3};
    let mut s = String::from("<robot name=\"irb\"><link name=\"l0\"/>");
    for (i, [alpha, a, d, offset]) in MDH.iter().enumerate() {
        let about_x = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), *alpha);
        let (r, p, y) = (about_x * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *offset)).euler_angles();
        let t = about_x * Vector3::new(0.0, 0.0, *d);
        s += &format!(
            "<link name=\"l{n}\"/><joint name=\"j{n}\" type=\"revolute\"><parent link=\"l{i}\"/><child link=\"l{n}\"/>\
             <origin xyz=\"{} {} {}\" rpy=\"{r} {p} {y}\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"-4\" upper=\"4\" effort=\"1\" velocity=\"1\"/></joint>",
            a + t.x,
            t.y,
            t.z,
            n = i + 1
        );
    }
    s + "</robot>"
}

fn openrr_k(task: &Task) {
    let chain = k::Chain::<f64>::from(&urdf_rs::read_from_string(&urdf()).unwrap());
    let arm = k::SerialChain::from_end(chain.find("j6").unwrap());
    let n = task.joints.len();
    if task.wants("forward kinematics") {
        let t = time(|i| {
            arm.set_joint_positions_unchecked(&task.joints[i % n]);
            arm.end_transform()
        });
        report("forward kinematics", "k, Rust", "k 0.32.0", t, "");
    }
    if task.wants("Jacobian") {
        let t = time(|i| {
            arm.set_joint_positions_unchecked(&task.joints[i % n]);
            arm.update_transforms();
            k::jacobian(&arm)
        });
        report("Jacobian", "k, Rust", "k 0.32.0", t, "");
    }
}

/// Closed form for arms of just this kind; with limits, as everybody in the row.
fn opw(task: &Task) {
    let range = |side: usize| std::array::from_fn(|j| LIMITS[j][side].to_radians());
    // the last joint turns once: all angles are within
    let (mut low, mut high): ([f64; 6], [f64; 6]) = (range(0), range(1));
    (low[5], high[5]) = (-PI + 1e-9, PI - 1e-9);
    let arm = OPWKinematics::new_with_constraints(Parameters::irb120_3_58(), Constraints::new(low, high, 0.0));
    let n = task.joints.len();
    if task.wants("forward kinematics") {
        let t = time(|i| arm.forward(&task.joints[i % n]));
        report("forward kinematics", "rs-opw-kinematics, Rust", "rs-opw-kinematics 3.0.0", t, "");
    }
    if !task.wants("inverse kinematics") {
        return;
    }
    let poses: Vec<_> = task.joints.iter().map(|q| arm.forward(q)).collect();
    let (mut found, mut worst) = (0, 0.0_f64);
    for pose in &poses {
        for q in arm.inverse(pose) {
            found += 1;
            worst = worst.max((arm.forward(&q).translation - pose.translation).length());
        }
    }
    let t = time(|i| arm.inverse(&poses[i % n]));
    let words = format!("{:.2} solutions within limits, off by at most {worst:.0e} m", found as f64 / n as f64);
    report("inverse kinematics", "rs-opw-kinematics, Rust, all solutions", "rs-opw-kinematics 3.0.0", t, &words);
}

/// IK-Geo's subproblems: spherical wrist, axes 2 and 3 parallel.
fn ik_geo_crate(task: &Task) {
    use ik_geo::inverse_kinematics::auxiliary::Kinematics;
    use ik_geo::inverse_kinematics::spherical_two_parallel;
    use nalgebra32::{Matrix3, Rotation3, Vector3, Vector6};
    if !task.wants("inverse kinematics") {
        return;
    }
    // product of exponentials at q = 0: axes, and steps from one axis to the next, in the base frame
    let mut kin = Kinematics::<6, 7>::new();
    let (mut r, mut o, mut last) = (Matrix3::<f64>::identity(), Vector3::<f64>::zeros(), Vector3::zeros());
    for (i, [alpha, a, d, offset]) in MDH.iter().enumerate() {
        let x: Vector3<f64> = r.column(0).into();
        r *= Rotation3::from_axis_angle(&Vector3::x_axis(), *alpha).matrix();
        let z: Vector3<f64> = r.column(2).into();
        o += x * *a + z * *d;
        r *= Rotation3::from_axis_angle(&Vector3::z_axis(), *offset).matrix();
        // the wrist's axes through its centre, so that the solver sees the sphere
        let through = if i >= 3 { wrist_centre() } else { o };
        kin.h.set_column(i, &z);
        kin.p.set_column(i, &(through - last));
        last = through;
    }
    kin.p.set_column(6, &(o - last));
    let n = task.joints.len();
    let poses: Vec<(Matrix3<f64>, Vector3<f64>)> =
        task.joints.iter().map(|q| kin.forward_kinematics(&Vector6::from_column_slice(q))).collect();
    let (mut found, mut worst) = (0, 0.0_f64);
    for (r, t) in &poses {
        for (q, least_squares) in std::iter::zip(spherical_two_parallel(r, t, &kin).0, spherical_two_parallel(r, t, &kin).1)
        {
            if !least_squares {
                found += 1;
                worst = worst.max((kin.forward_kinematics(&q).1 - t).norm());
            }
        }
    }
    let t = time(|i| spherical_two_parallel(&poses[i % n].0, &poses[i % n].1, &kin));
    let words = format!("{:.2} solutions, limits not looked at, off by at most {worst:.0e} m", found as f64 / n as f64);
    report("inverse kinematics", "ik-geo, Rust, all solutions", "ik-geo 0.1.2", t, &words);
}

/// Where the last three axes meet at q = 0.
fn wrist_centre() -> nalgebra32::Vector3<f64> {
    // shoulder at 0.29, upper arm 0.27 up, then 0.07 up and 0.302 forward
    nalgebra32::Vector3::new(0.302, 0.0, 0.290 + 0.270 + 0.070)
}

/// Frames of the six links.
fn frames(q: &[f64; 6]) -> [Pose; 7] {
    let mut t = Pose::IDENTITY;
    let mut out = [Pose::IDENTITY; 7];
    for (i, [alpha, a, d, offset]) in MDH.iter().enumerate() {
        let (s, c) = (alpha / 2.0).sin_cos();
        let about_x = parry3d_f64::math::Rotation::from_xyzw(s, 0.0, 0.0, c);
        let (s, c) = ((q[i] + offset) / 2.0).sin_cos();
        let about_z = parry3d_f64::math::Rotation::from_xyzw(0.0, 0.0, s, c);
        let step = about_x * Vector::new(0.0, 0.0, *d) + Vector::new(*a, 0.0, 0.0);
        t = t * Pose::from_parts(step, about_x * about_z);
        out[i + 1] = t;
    }
    out
}

fn collision(task: &Task, kind: &str) {
    let row = format!("collision check, {kind}s");
    if !task.wants(&row) {
        return;
    }
    let mut parts: Vec<(usize, Pose, SharedShape)> = Vec::new();
    for line in task.read(&format!("scene_{kind}.txt")).lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let x: Vec<f64> = words.iter().filter_map(|w| w.parse().ok()).collect();
        let shape = match words[4] {
            "capsule" => SharedShape::capsule_z(x[5] / 2.0, x[4]),
            "box" => SharedShape::cuboid(x[4] / 2.0, x[5] / 2.0, x[6] / 2.0),
            _ => {
                let points: Vec<Vector> = x[5..].chunks(3).map(|p| Vector::new(p[0], p[1], p[2])).collect();
                SharedShape::convex_hull(&points).unwrap()
            }
        };
        parts.push((x[0] as usize, Pose::translation(x[1], x[2], x[3]), shape));
    }
    let links = parts.iter().filter(|p| p.0 > 0).count();
    let mut pairs = Vec::new();
    for i in 0..links {
        pairs.extend((links..parts.len()).map(|j| (i, j)));
        pairs.extend((i + 3..links).map(|j| (i, j)));
    }
    let check = |q: &[f64; 6]| {
        let f = frames(q);
        let place: [Pose; 12] = std::array::from_fn(|k| f[parts[k].0] * parts[k].1);
        pairs.iter().any(|(i, j)| {
            query::intersection_test(&place[*i], &*parts[*i].2.0, &place[*j], &*parts[*j].2.0).unwrap().intersecting
        })
    };
    let n = task.joints.len();
    let hits = task.joints.iter().filter(|q| check(q)).count();
    let t = time(|k| check(&task.joints[k % n]));
    let words = format!("{} pairs, {hits} of {n} collide", pairs.len());
    report(&row, "parry, Rust, every pair", "parry3d-f64 0.31.1", t, &words);
}
