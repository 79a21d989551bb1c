//! How many parameters an arm has, against the literature.
//!
//! A complete, minimal and continuous kinematic model of R revolute and P prismatic joints has N = 4 R + 2 P + 6 parameters where
//! the whole pose of the tool is measured (Everett, Driels & Mooring 1987; Mooring, Roth & Driels 1991): four for the line of a
//! revolute axis, two for the direction of a prismatic one, six for the last frame; the base is part of the first axes. Where
//! only a point of the tool is measured, the last frame counts three: N = 4 R + 2 P + 3. A tool point *on* a last revolute axis
//! does not feel where that axis points (see the SCARA).
//!
//! Craig's four numbers a joint miss one twist, Hayati's beta, for each pair of consecutive revolute axes that are parallel: so
//! many fewer does the geometry without beta have.

use std::path::Path;

use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use trical_ident::fit::identifiability::independent_terms;
use trical_ident::{Choice, Dataset, JointSource, ParameterSet};
use trical_model::{
    Axis, Basis, Cell, Forward, Measured, Model, Motion, Parameter, Pose, Recording, Robot, Row, Site, State, Term,
};

/// A tool whose point is on no axis.
const CELL: &str = "[base]\nxyz_mm = [100.0, 200.0, 50.0]\nzyx_deg = [30.0, 5.0, -4.0]\n[tool]\ntcp_mm = [31.0, -22.0, 118.0]\n\
                    targets_mm = [[31.0, -22.0, 118.0]]\n";

const POINT: Measured = Measured::Point { target: 0, position: [0.0; 3] };
const POSE: Measured = Measured::Pose { position: [0.0; 3], quaternion: [1.0, 0.0, 0.0, 0.0] };

fn shipped(file: &str) -> Robot {
    Robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file)).unwrap()
}

/// Rows of alpha_deg, a_mm, d_mm, kind.
fn made(rows: &[(f64, f64, f64, &str)]) -> Robot {
    let mut text = "name = 'made'\n".to_owned();
    for (alpha, a, d, kind) in rows {
        let limits = if *kind == "prismatic" { "limits_mm = [-100.0, 100.0]" } else { "limits_deg = [-170.0, 170.0]" };
        text += &format!(
            "[[joint]]\nkind = '{kind}'\nalpha_deg = {alpha:?}\na_mm = {a:?}\nd_mm = {d:?}\ntheta_offset_deg = 0.0\n{limits}\n"
        );
    }
    Robot::parse(&text, "made.toml").unwrap()
}

/// Number of geometric parameters that the library identifies; compliance, which the set may have too, is not counted.
fn kept(robot: &Robot, cell: &str, measured: Measured, set: ParameterSet) -> usize {
    let cell = Cell::parse(cell, "cell.toml").unwrap();
    let mut robot = robot.clone();
    for j in &mut robot.joints {
        j.mass = j.mass.or(Some(1.0));
    }
    let row = Row { state: State::at(&[]), measured, seq: None, line: 2 };
    let recording = Recording { name: "made".into(), joints: robot.dof(), rows: vec![row], ..Recording::default() };
    let data = Dataset::build(&[recording], JointSource::Read, None).unwrap();
    let mut model = Model::nominal(robot, cell);
    model.frames = vec![Pose::identity()];
    let terms = independent_terms(&model, &data, &Choice::from(set)).unwrap().0;
    terms.iter().filter(|t| t.effect != "compliance").count()
}

/// Rank of the derivatives to everything constant that the library can move: frame, base, tool, all link parameters with all
/// betas, and tilts of all axes. No list of candidates can have more.
fn rank(robot: &Robot, cell: &str, measured: Measured) -> usize {
    let cell = Cell::parse(cell, "cell.toml").unwrap();
    let n = robot.dof();
    let mut model = Model::nominal(robot.clone(), cell);
    model.frames = vec![Pose::identity()];
    let mut sites: Vec<Site> = Motion::ALL.iter().map(|m| Site::Frame { frame: 1, motion: *m }).collect();
    sites.extend(Motion::ALL.map(Site::Base));
    sites.extend(Motion::ALL.map(Site::Tool));
    sites.extend(Axis::ALL.map(|axis| Site::Target { target: 1, axis }));
    for k in 0..n {
        sites.extend([Parameter::Alpha, Parameter::A, Parameter::Beta].map(|p| Site::Link { link: k, parameter: p }));
        sites.extend([Parameter::Theta, Parameter::D].map(|p| Site::Link { link: k + 1, parameter: p }));
        sites.extend([Axis::X, Axis::Y].map(|axis| Site::Tilt { joint: k + 1, axis }));
    }
    model.terms = sites.iter().map(|s| Term::new(format!("{s:?}"), "geometry", *s, Basis::CONSTANT)).collect();
    let p = model.terms.len();
    let forward = Forward::new(model, (0..p).collect()).unwrap();
    let mut ws = forward.workspace();
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut jacobian = vec![0.0; 6 * p];
    let mut rows = Vec::new();
    for _ in 0..60 {
        let q: Vec<f64> =
            robot.joints.iter().map(|j| rng.random_range(j.limits[0].max(-3.0)..j.limits[1].min(3.0))).collect();
        let state = State::at(&q);
        let seen = match measured {
            Measured::Pose { position, .. } => {
                let tool = forward.world_from_tool(&state, &mut ws).rotation;
                Measured::Pose { position, quaternion: trical_model::pose::quaternion_from_rotation(&tool) }
            }
            other => other,
        };
        let count = forward.linearize(&state, &seen, 0, &mut ws, &mut jacobian);
        rows.extend(jacobian[..count * p].chunks(p).map(<[f64]>::to_vec));
    }
    let s = DMatrix::from_fn(rows.len(), p, |i, j| rows[i][j]).singular_values();
    let mut s: Vec<f64> = s.iter().copied().collect();
    s.sort_by(|a, b| b.total_cmp(a));
    let rank = s.iter().filter(|x| **x > 1e-9 * s[0]).count();
    // a gap, not a slope: what counts is far above what does not
    assert!(s[rank - 1] > 1e-5 * s[0] && s.get(rank).is_none_or(|x| *x < 1e-12 * s[0]), "{s:?}");
    rank
}

/// `revolute` and `prismatic` joints, `parallel` pairs of consecutive parallel axes that need a beta.
fn counts(robot: &Robot, revolute: usize, prismatic: usize, parallel: usize) {
    let joints = 4 * revolute + 2 * prismatic;
    for (measured, last) in [(POINT, 3), (POSE, 6)] {
        let expected = joints + last;
        assert_eq!(rank(robot, CELL, measured), expected, "{} as a whole", robot.name);
        for set in [ParameterSet::Geometry, ParameterSet::Complete] {
            assert_eq!(kept(robot, CELL, measured, set), expected, "{} {set:?}", robot.name);
        }
        assert_eq!(
            kept(robot, CELL, measured, ParameterSet::Compliance),
            expected - parallel,
            "{} without beta",
            robot.name
        );
    }
}

#[test]
fn arms_with_one_pair_of_parallel_axes_have_27_parameters_by_position_and_26_without_beta() {
    for file in ["cells/irb120/robot.toml", "robots/meca500.toml", "robots/kr6_r700.toml", "robots/lrmate_200id.toml"] {
        counts(&shipped(file), 6, 0, 1);
    }
}

#[test]
fn arms_like_the_ur10_have_two_pairs_and_25_without_beta() {
    counts(&shipped("cells/ur10/robot.toml"), 6, 0, 2);
    counts(&shipped("robots/ur5e.toml"), 6, 0, 2);
}

#[test]
fn an_arm_of_seven_axes_has_31_by_position_and_34_by_pose() {
    // lengths of the Franka Emika arm: no axes parallel, consecutive ones intersect or stand 82.5 and 88 mm apart
    let arm = made(&[
        (0.0, 0.0, 333.0, "revolute"),
        (-90.0, 0.0, 0.0, "revolute"),
        (90.0, 0.0, 316.0, "revolute"),
        (90.0, 82.5, 0.0, "revolute"),
        (-90.0, -82.5, 384.0, "revolute"),
        (90.0, 0.0, 0.0, "revolute"),
        (90.0, 88.0, 107.0, "revolute"),
    ]);
    counts(&arm, 7, 0, 0);
}

/// Two revolute joints, a slide and a revolute joint, all vertical.
fn scara() -> Robot {
    made(&[
        (0.0, 0.0, 300.0, "revolute"),
        (0.0, 250.0, 50.0, "revolute"),
        (0.0, 200.0, 0.0, "prismatic"),
        (0.0, 0.0, -100.0, "revolute"),
    ])
}

#[test]
fn a_scara_has_17_by_position_and_20_by_pose() {
    // all four axes parallel: betas between 1 and 2, 2 and the slide, the slide and 4
    counts(&scara(), 3, 1, 3);
}

#[test]
fn a_scara_whose_tool_is_on_its_last_axis_does_not_feel_that_axis() {
    // turning joint 4 does not move the point: of its line's four numbers and the point's three only the point's three, seen
    // from the slide, are left
    let on_axis = CELL.replace("31.0, -22.0, 118.0", "0.0, 0.0, 118.0");
    let expected = 4 * 2 + 2 + 3 + 2;
    assert_eq!(rank(&scara(), &on_axis, POINT), expected);
    assert_eq!(kept(&scara(), &on_axis, POINT, ParameterSet::Complete), expected);
}

#[test]
fn a_gantry_of_three_slides_has_9_by_position_and_12_by_pose() {
    let arm = made(&[(0.0, 0.0, 0.0, "prismatic"), (-90.0, 0.0, 0.0, "prismatic"), (-90.0, 0.0, 0.0, "prismatic")]);
    counts(&arm, 0, 3, 0);
}

#[test]
fn too_few_measurements_name_the_row_that_was_rejected_of_them() {
    let mut data = crate::arm::touches_of(9);
    let reason = "1.204 mm off, 31 times what is usual".to_owned();
    data.rejected.push(trical_ident::Rejected { recording: "new.csv".into(), line: 7, row: 6, reason });
    let error = trical_ident::fit::residuals::check_count(&data, 32, &[]).unwrap_err().to_string();
    let said = "9 measurements give 27 numbers (1 row rejected, line 7: 1.204 mm off, 31 times what is usual), but 32";
    assert!(error.starts_with(said), "{error}");
}
