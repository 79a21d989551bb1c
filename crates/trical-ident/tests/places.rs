//! Balls and printed sockets at unknown places: their pose is identified with the arm, and the arm is scored at places that it did not see.

use nalgebra::Vector3;
use trical_ident::{ModelFile, Options, ParameterSet, calibrate, validate};
use trical_model::{Basis, Cell, Model, Recording, Shape, Site, Task, Term, Variable};

/// Standard deviation of each coordinate, m; the mean length of such a vector, mm.
const NOISE: f64 = 5e-5;
const LEAST_MM: f64 = 0.08;

/// Touches by the true arm of balls that `cell` has, at the named places.
fn touched(cell: &Cell, places: &[usize], seed: u64) -> (Model, Recording) {
    touched_with(Vec::new(), cell, places, seed)
}

/// The same by an arm that has more terms.
fn touched_with(more: Vec<Term>, cell: &Cell, places: &[usize], seed: u64) -> (Model, Recording) {
    let mut truth = crate::arm::truth(ParameterSet::Geometry, 3);
    truth.terms.extend(more);
    let recording = crate::arm::touch_in_sockets(&mut truth, cell, places, NOISE, seed);
    (truth, recording)
}

fn cell(balls: &str) -> Cell {
    let text =
        format!("[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [0, 0, 0]\n[tool]\ntcp_mm = [15, -10, 120]\n[balls]\n{balls}");
    Cell::parse(&text, "cell.toml").unwrap()
}

#[test]
fn two_sockets_at_unknown_places_calibrate_the_arm_to_their_noise() {
    let cell = cell("distances_mm = { d12 = 50.0 }");
    let (truth, recording) = touched(&cell, &[0, 1, 2, 3], 1);
    let c =
        calibrate(&truth.robot, &cell, &[recording], &Options::new(ParameterSet::Geometry), &Task::silent()).unwrap();
    assert!(!c.fitted.model.terms.iter().any(|t| matches!(t.site, Site::Base(_))), "two sockets fix no base");
    assert!(c.before.mean_mm > 0.5, "{:?}", c.before);
    assert!(c.errors.mean_mm < 1.1 * LEAST_MM, "{:?}", c.errors);
    let by_place = c.held_out.by_place.unwrap();
    assert!(by_place.mean_mm < 2.5 * LEAST_MM, "{by_place:?}");
    assert_eq!(c.held_out.forward, None, "a fit to the poses before knows one socket of the last place only");
    // nobody said where the sockets stand, only how far they are from each other
    let shown = |name: &str| {
        let term = c.fitted.model.terms.iter().find(|t| t.name == name).unwrap();
        trical_ident::shown(&c.fitted.model, term)
    };
    let (x, distance) = (shown("place1_x"), shown("place1_distance"));
    assert_eq!((x.nominal, distance.nominal), (None, Some(50.0)));
    assert!((distance.value - 50.0).abs() < 0.5 && distance.value != 50.0, "{distance:?}");
    assert_eq!(c.distances.len(), 4);
    for d in &c.distances {
        assert!((d.measured_mm - 50.0).abs() < 0.5 && d.balls == [1, 2] && d.cell_mm == 50.0, "{d:?}");
    }
    // a place that the model never saw: its pose from half of the touches, the other half scored
    let file =
        ModelFile::parse(&ModelFile::of(c.fitted.model, &c.fitted.data).to_toml().unwrap(), "calibrated.toml").unwrap();
    assert_eq!(file.sessions[0].places, ["place 0", "place 1", "place 2", "place 3"]);
    let (_, other) = touched(&cell, &[4], 7);
    let v = validate(&truth.robot, &cell, &file, &[other], None, None).unwrap();
    assert_eq!((v.sessions[0].from_poses, v.sessions[0].poses, &v.sessions[0].refitted[..]), (20, 20, &["frame"][..]));
    assert!(
        v.after.mean_mm < 2.5 * LEAST_MM && v.before.mean_mm > 4.0 * v.after.mean_mm,
        "{:?} {:?}",
        v.before,
        v.after
    );
}

#[test]
fn a_place_with_one_row_is_told_and_the_others_are_scored() {
    let cell = cell("distances_mm = { d12 = 50.0 }");
    let (truth, mut recording) = touched(&cell, &[0, 1, 2, 3], 1);
    recording.places.push("lfet".into());
    recording.rows[17].state.place = Some(4);
    let c =
        calibrate(&truth.robot, &cell, &[recording], &Options::new(ParameterSet::Geometry), &Task::silent()).unwrap();
    let by_place = c.held_out.by_place.unwrap();
    assert!(by_place.mean_mm < 2.5 * LEAST_MM, "{by_place:?}");
    let told = |c: &String| c.starts_with("place lfet has 1 pose, the first in line 19");
    assert!(c.cautions().iter().any(told), "{:?}", c.cautions());
}

#[test]
fn waves_of_the_joints_are_kept_where_places_that_were_held_out_show_them() {
    let cell = cell("distances_mm = { d12 = 50.0 }");
    let wave = |joint: usize| {
        let basis = Basis::new(Variable::Joint { joint }, Shape::Sine { cycles: 2.0 });
        Term { value: 1e-3, ..Term::new(format!("wave_{joint}"), "hidden", Site::Joint { joint }, basis) }
    };
    for (more, kept) in [(Vec::new(), "nothing"), ((1..=6).map(wave).collect(), "harmonics of each joint")] {
        let (truth, recording) = touched_with(more, &cell, &[0, 1, 2, 3, 4], 21);
        let c = calibrate(&truth.robot, &cell, &[recording], &Options::new(ParameterSet::Compliance), &Task::silent());
        let tried = c.unwrap().tried;
        let said: Vec<_> = tried.iter().map(|t| (t.added, t.mean_mm, t.kept)).collect();
        assert!(tried.iter().all(|t| t.kept == (t.added == kept) && t.mean_mm.is_some()), "{kept}: {said:?}");
    }
}

#[test]
fn one_socket_without_any_distance_holds_the_scale_by_the_arms_lengths() {
    let cell = cell("");
    let (truth, recording) = touched(&cell, &[0, 1, 2, 3], 11);
    let c =
        calibrate(&truth.robot, &cell, &[recording], &Options::new(ParameterSet::Geometry), &Task::silent()).unwrap();
    assert!(c.errors.mean_mm < 1.1 * LEAST_MM, "{:?}", c.errors);
    assert!(c.cautions().iter().any(|c| c.contains("no distance")), "{:?}", c.cautions());
}

#[test]
fn a_plate_of_three_balls_that_is_turned_and_carried_elsewhere_is_found_there() {
    let cell = cell("distances_mm = { d12 = 300, d13 = 300, d23 = 300 }");
    let (truth, mut recording) = touched(&cell, &[0, 1], 21);
    recording.name = "plate.csv".into();
    let c =
        calibrate(&truth.robot, &cell, &[recording], &Options::new(ParameterSet::Geometry), &Task::silent()).unwrap();
    let turns = c.fitted.model.terms.iter().filter(|t| t.effect == "place").count();
    assert_eq!(turns, 6, "{:?}", c.fitted.model.terms.iter().map(|t| &t.name).collect::<Vec<_>>());
    assert!(c.fitted.model.terms.iter().any(|t| matches!(t.site, Site::Base(_))));
    assert!(c.errors.mean_mm < 1.1 * LEAST_MM, "{:?}", c.errors);
}

#[test]
fn sockets_are_written_as_one_distance_or_none() {
    assert_eq!(cell("distances_mm = { d12 = 50.0 }").balls, [Vector3::zeros(), Vector3::new(0.05, 0.0, 0.0)]);
    assert_eq!(cell("").balls, [Vector3::zeros()]);
    let wrong = |balls: &str| {
        let text =
            format!("[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [0, 0, 0]\n[tool]\ntcp_mm = [0, 0, 0]\n[balls]\n{balls}");
        Cell::parse(&text, "cell.toml").unwrap_err().to_string()
    };
    assert_eq!(
        wrong("distances_mm = { d12 = 50, d13 = 50 }"),
        "cell.toml, [balls] distances_mm: found d12 and d13, expected d12, d13 and d23 of three balls, or d12 of two"
    );
    assert!(wrong("distances_mm = { d12 = 0 }").contains("expected a distance above 0"));
}

/// A SCARA's last axis is vertical in every pose: the length of its tool and the heights of all unknown places are one.
#[test]
fn a_tool_that_only_raises_all_unknown_places_stays_as_the_cell_file_has_it() {
    let joint = |kind: &str, alpha: u8, a: u16, d: u16, limits: &str| {
        format!("[[joint]]\n{kind}alpha_deg = {alpha}\na_mm = {a}\nd_mm = {d}\ntheta_offset_deg = 0\n{limits}\n")
    };
    let text = "name = \"SCARA\"\n".to_owned()
        + &joint("", 0, 0, 380, "limits_deg = [-130, 130]")
        + &joint("", 0, 325, 0, "limits_deg = [-145, 145]")
        + &joint("kind = \"prismatic\"\n", 180, 275, 0, "limits_mm = [0, 200]")
        + &joint("", 0, 0, 0, "limits_deg = [-360, 360]");
    let robot = trical_model::Robot::parse(&text, "scara.toml").unwrap();
    let text =
        "[base]\nxyz_mm = [0, 0, 0]\nzyx_deg = [0, 0, 0]\n[tool]\ntcp_mm = [60, -25, 60]\n[balls]\ndistances_mm = {}";
    let cell = Cell::parse(text, "cell.toml").unwrap();
    let mut truth = Model::nominal(robot.clone(), cell.clone());
    for (name, link, value) in [("a_1", 1, 4e-4), ("a_2", 2, -3e-4)] {
        let site = Site::Link { link, parameter: trical_model::Parameter::A };
        truth.terms.push(Term { value, ..Term::new(name, "geometry", site, Basis::CONSTANT) });
    }
    let forward = trical_model::Forward::new(truth, Vec::new()).unwrap();
    let mut ws = forward.workspace();
    let mut recording = Recording { name: "sockets.csv".into(), joints: 4, ..Recording::default() };
    // parts of multiples of square roots, which have no period
    let part = |k: usize, step: f64| ((k as f64 + 0.5) * step).fract() - 0.5;
    let sockets = [[0.40, 0.10, 0.15], [0.25, -0.35, 0.152], [0.05, 0.45, 0.148]];
    for (place, socket) in sockets.into_iter().enumerate() {
        recording.places.push(format!("p{}", place + 1));
        for _ in 0..30 {
            let k = recording.rows.len();
            // the wrist is where the tool, turned by psi, is at the socket: a plane arm of two links
            let psi = 6.0 * part(k, 0.4142);
            let tool = nalgebra::Rotation2::new(psi) * nalgebra::Vector2::new(0.06, 0.025);
            let (x, y) = (socket[0] - tool.x, socket[1] - tool.y);
            let elbow =
                ((x * x + y * y - 0.325 * 0.325 - 0.275 * 0.275) / (2.0 * 0.325 * 0.275)).clamp(-1.0, 1.0).acos();
            let elbow = if k.is_multiple_of(2) { elbow } else { -elbow };
            let shoulder = y.atan2(x) - (0.275 * elbow.sin()).atan2(0.325 + 0.275 * elbow.cos());
            let q = [shoulder, elbow, 0.32 - socket[2] + 4e-4 * part(k, 0.7321), shoulder + elbow - psi];
            let state = trical_model::State { place: Some(place), ..trical_model::State::at(&q) };
            let tcp = forward.world_from_tool(&state, &mut ws);
            let i = tcp.rotation.transpose() * (Vector3::from(socket) - tcp.translation);
            let reading = std::array::from_fn(|a| i[a] + NOISE * 3.4 * part(k, [0.2361, 0.6458, 0.3166][a]));
            let measured = trical_model::Measured::Touch { ball: 0, reading };
            recording.rows.push(trical_model::Row { state, measured, seq: None, line: k + 2 });
        }
    }
    let c = calibrate(&robot, &cell, &[recording], &Options::new(ParameterSet::Geometry), &Task::silent()).unwrap();
    let told = c.fitted.left_out();
    assert!(told.iter().any(|t| t == "tool_z (moves together with place1_z, place2_z, place3_z)"), "{told:?}");
    for (k, socket) in sockets.iter().enumerate() {
        let term = c.fitted.model.terms.iter().find(|t| t.name == format!("place{}_z", k + 1)).unwrap();
        let z = trical_ident::shown(&c.fitted.model, term).value;
        assert!((z - 1e3 * socket[2]).abs() < 0.5, "place {}: {z}", k + 1);
    }
    assert!(c.errors.mean_mm < 1.3 * LEAST_MM, "{:?}", c.errors);
}
