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

#[test]
fn a_ball_inside_an_obstacle_is_refused() {
    let wall = "[[geometry.obstacle]]\nname = \"wall\"\nsolids = [{ shape = \"box\", center_mm = [300.0, 0.0, 0.0], \
                size_mm = [20.0, 20.0, 400.0] }]\n";
    assert_eq!(
        problem(wall),
        "[geometry]: 'ball 2' reaches 6.3 mm or more into 'wall', expected balls that stand free: nothing could touch it"
    );
    // beside it is well
    geometry(&bare(&wall.replace("300.0, 0.0, 0.0", "330.0, 0.0, 0.0"))).unwrap();
}

#[test]
fn a_mesh_beside_the_cell_is_the_box_that_it_draws() {
    let folder = std::env::temp_dir().join(format!("trical-mesh-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut text = String::new();
    for k in 0..8 {
        let at = |bit: i32| if k & bit == 0 { -1.0 } else { 1.0 };
        text += &format!("v {} {} {}\n", at(1), at(2), at(4));
    }
    text += "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n";
    std::fs::write(folder.join("block.obj"), text).unwrap();
    let with = |solid: &str| {
        let section = format!("[[geometry.obstacle]]\nname = \"block\"\nsolids = [{solid}]\n");
        let mut cell = Cell::parse(&bare(&section), "cell.toml").unwrap();
        mesh::resolve_meshes(&mut cell, &folder).map(|()| cell)
    };
    let robot = crate::plan::tests::irb120().0;
    let mesh = "{ shape = \"mesh\", file = \"block.obj\", unit_mm = 50.0, at_mm = [0.0, 400.0, 300.0], zyx_deg = [30.0, 0.0, 0.0] }";
    let boxed = "{ shape = \"box\", center_mm = [0.0, 400.0, 300.0], size_mm = [100.0, 100.0, 100.0], zyx_deg = [30.0, 0.0, 0.0] }";
    let body = |solid| {
        let cell = with(solid).unwrap();
        let g = Geometry::of(&robot, &cell).unwrap();
        g.bodies.into_iter().find(|b| b.name == "block").unwrap().solids.remove(0)
    };
    let (a, b) = (body(mesh), body(boxed));
    let still = trical_model::Pose::identity();
    for k in 0..200 {
        let (s, c) = (f64::from(k) * 0.7).sin_cos();
        let probe = Solid::sphere(Vector3::new(0.3 * s, 0.4 + 0.3 * c, 0.003 * f64::from(k)), 0.01);
        let (x, y) =
            (crate::solid::distance(&still, &a, &still, &probe), crate::solid::distance(&still, &b, &still, &probe));
        // hulls go through the iteration, whose slack is taken off
        assert!((x - y).abs() < 1.5e-4, "{x} {y}");
    }
    let missing = with("{ shape = \"mesh\", file = \"no.stl\" }").unwrap_err().to_string();
    assert!(missing.starts_with("[[geometry.obstacle]] 1, solid 1, file: no.stl: cannot be read"), "{missing}");
    let unknown = with("{ shape = \"mesh\", file = \"block.obj\", colour = 1 }").unwrap_err().to_string();
    assert!(unknown.contains("unknown field `colour`"), "{unknown}");
    std::fs::remove_dir_all(&folder).unwrap();
}
