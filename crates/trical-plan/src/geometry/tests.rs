#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use super::*;
use crate::error::PlanError;

const ROBOT: &str = include_str!("../../../../cells/irb120/robot.toml");
const SHIPPED: &str = include_str!("../../../../cells/irb120/cell.toml");

fn geometry(text: &str) -> Result<Geometry> {
    let robot = Robot::parse(ROBOT, "robot.toml").unwrap();
    let cell = Cell::parse(text, "cell.toml").unwrap();
    Geometry::of(&robot, &cell)
}

fn bare(section: &str) -> String {
    format!(
        "[base]\nxyz_mm = [150.0, -330.0, -150.0]\nzyx_deg = [90.0, 0.0, 0.0]\n[tool]\ntcp_mm = [18.0, -12.0, 118.0]\n\
         [balls]\ndistances_mm = {{ d12 = 300.0, d13 = 300.0, d23 = 300.0 }}\n{section}"
    )
}

fn problem(section: &str) -> String {
    match geometry(&bare(section)).unwrap_err() {
        e @ PlanError::Geometry { .. } => e.to_string(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_cell_without_geometry_gets_all_of_it() {
    let g = geometry(&bare("")).unwrap();
    let names: Vec<&str> = g.bodies.iter().map(|b| b.name.as_str()).collect();
    for name in ["link 0", "link 6", "stem x", "gauge z", "floor", "platform", "ball 1", "ball 3", "post 2"] {
        assert!(names.contains(&name), "{names:?}");
    }
    assert!((g.margin - 5e-3).abs() < 1e-15);
}

#[test]
fn an_empty_list_means_that_there_is_nothing() {
    let g = geometry(&bare("[geometry]\nobstacle = []\n")).unwrap();
    assert!(g.bodies.iter().all(|b| b.name != "floor" && b.name != "platform"));
}

#[test]
fn the_shipped_cell_is_read() {
    let g = geometry(SHIPPED).unwrap();
    let stems: Vec<_> =
        g.bodies.iter().filter_map(|b| if let Role::Stem(s) = b.role { Some(s) } else { None }).collect();
    assert_eq!(stems.len(), 3);
    for (s, axis) in stems.iter().zip([Vector3::x(), Vector3::y(), Vector3::z()]) {
        assert!((s + axis).norm() < 1e-12, "{s:?}");
    }
}

#[test]
fn errors_name_the_place_what_was_found_and_what_is_expected() {
    assert!(
        problem("[geometry]\nmargins_mm = 2\n")
            .contains("[geometry]: unknown field `margins_mm`, expected one of `margin_mm`")
    );
    assert_eq!(problem("[geometry]\nmargin_mm = -2.0\n"), "[geometry], margin_mm: found -2, expected 0.2 to 100 mm");
    let e =
        problem("[[geometry.link]]\nlink = 1\nsolids = [{ shape = 'sphere', centre_mm = [0, 0, 0], radius_mm = 5 }]\n");
    assert!(e.starts_with("[[geometry.link]] 1, solid 1: unknown field `centre_mm`, expected `center_mm`"), "{e}");
    let e =
        problem("[[geometry.link]]\nlink = 9\nsolids = [{ shape = 'sphere', center_mm = [0, 0, 0], radius_mm = 5 }]\n");
    assert_eq!(e, "[[geometry.link]] 1, link: found 9, expected 0 (the base) to 6 (the flange)");
    let e = problem("[[geometry.obstacle]]\nname = 'x'\nsolids = [{ shape = 'cone', radius_mm = 5 }]\n");
    assert!(e.contains("[[geometry.obstacle]] 1, solid 1: unknown variant `cone`"), "{e}");
    let e = problem("[[geometry.obstacle]]\nname = 'x'\nsolids = []\n");
    assert_eq!(e, "[[geometry.obstacle]] 1: solids is empty, expected one solid or more");
    let e = problem("[geometry]\nignore = [['link 1', 'lnk 3']]\n");
    assert!(e.starts_with("[geometry], ignore: 'lnk 3' is no body of this cell, expected one of: link 0, "), "{e}");
    let e = problem(
        "[[geometry.obstacle]]\nname = 'x'\nsolids = [{ shape = 'hull', points_mm = [[0,0,0],[1,0,0],[0,1,0],[1,1,0]] }]\n",
    );
    assert_eq!(
        e,
        "[[geometry.obstacle]] 1, solid 1, points_mm: 4 points in one plane, expected four or more that span a volume"
    );
    let e = problem("[geometry.balls]\ndiameter = 5\n");
    assert!(e.starts_with("[geometry.balls]: unknown field `diameter`"), "{e}");
    let e = problem(
        "[[geometry.device]]\nname = 'a'\nsolids = [{ shape = 'sphere', center_mm = [0, 0, 0], radius_mm = nan }]\n",
    );
    assert_eq!(e, "[[geometry.device]] 1, solid 1, radius_mm: found NaN, expected 0.1 to 100000 mm");
    let e = problem("[geometry]\nretreat = [0.0, 1.0, -1.0]\n");
    assert!(
        e.starts_with("[geometry], retreat: found [0.000, 0.707, -0.707], which pushes 'stem x' into the ball"),
        "{e}"
    );
    let e = problem("[geometry]\nretreat = [0.0, 0.0, 0.0]\n");
    assert_eq!(e, "[geometry], retreat: found [0.0, 0.0, 0.0], expected a direction");
}

#[test]
fn a_device_leaves_along_all_of_its_stems_unless_told_otherwise() {
    let g = geometry(&bare("")).unwrap();
    assert!((g.retreat - Vector3::new(-1.0, -1.0, -1.0).normalize()).norm() < 1e-12);
    let g = geometry(&bare("[geometry]\ndevice = []\n")).unwrap();
    assert!((g.retreat + Vector3::z()).norm() < 1e-12);
}
