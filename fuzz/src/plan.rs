//! Plans, the geometry of a cell, meshes.

use std::path::Path;

use trical_model::{Cell, Robot, State};
use trical_plan::geometry::mesh::resolve_meshes;
use trical_plan::{CollisionModel, read_plan, write_plan};

fn robot() -> Robot {
    Robot::parse(include_str!("../../cells/irb120/robot.toml"), "robot.toml").unwrap()
}

/// `plan.csv` for the IRB 120 and three balls: nothing beyond its limits, and read back as it was written.
pub fn plan(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let robot = robot();
    let Ok(plan) = read_plan(text, "plan.csv", &robot, 3) else { return false };
    for e in &plan {
        for q in e.via.iter().chain([&e.joints, &e.approach]) {
            assert!(q.iter().all(|q| q.is_finite()) && robot.within_limits(q, 0.0), "{text}");
        }
        assert!(e.ball < 3, "{text}");
    }
    let written = write_plan(&robot, &plan);
    let again = read_plan(&written, "plan.csv", &robot, 3).unwrap_or_else(|e| panic!("{e}\n{text}\n{written}"));
    assert_eq!((again.len(), write_plan(&robot, &again)), (plan.len(), written), "{text}");
    true
}

/// `cell.toml` of an IRB 120 with its `[geometry]`: bodies whose distances are numbers.
pub fn geometry(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    // a mesh would read whatever file the bytes name
    if text.contains("mesh") {
        return false;
    }
    let Ok(cell) = Cell::parse(text, "c.toml") else { return false };
    let Ok(model) = CollisionModel::new(&robot(), &cell) else { return false };
    let forward = model.forward();
    let links = forward.world_from_links(&State::at(&[0.3; 6]), &mut forward.workspace());
    let clearance = model.clearance(&links, None);
    assert!(clearance.is_none_or(|(d, _)| d.is_finite()), "{text}");
    assert!(model.margin().is_finite() && (model.retreat().norm() - 1.0).abs() < 1e-9, "{text}");
    true
}

/// STL and OBJ, as a solid of a cell: one convex body, or one for each shell.
pub fn mesh(data: &[u8]) -> bool {
    let mut taken = false;
    for (end, shells) in [("stl", false), ("obj", false), ("obj", true)] {
        let path = std::env::temp_dir().join(format!("trical-fuzz-{}.{end}", std::process::id()));
        std::fs::write(&path, data).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        let mut cell = Cell::parse(include_str!("../../cells/irb120/cell.toml"), "cell.toml").unwrap();
        let section = format!(
            "[[obstacle]]\nname = \"m\"\nsolids = [{{ shape = \"mesh\", file = \"{name}\", shells = {shells} }}]"
        );
        cell.geometry = Some(section.parse().unwrap());
        let done = resolve_meshes(&mut cell, path.parent().unwrap_or(Path::new(".")));
        std::fs::remove_file(&path).unwrap();
        if done.is_ok() {
            assert!(!cell.geometry.unwrap().to_string().contains("nan"), "{}", data.escape_ascii());
            taken = true;
        }
    }
    taken
}
