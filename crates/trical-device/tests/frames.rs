//! Files of tools and frames (`--frames`) with a few characters changed: no panic, and only rigid transforms are taken.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../trical-model/tests/common/mutants.rs"]
mod common;

use trical_device::program::load_frames;
use trical_model::Pose;

fn is_rigid(p: &Pose) -> bool {
    let r = p.rotation * p.rotation.transpose();
    (r - nalgebra::Matrix3::identity()).amax() < 1e-9 && p.translation.iter().all(|x| x.is_finite())
}

#[test]
fn tools_and_frames() {
    let seed = "[world]\nxyz_mm = [0, 0, 290.0]\n[tools.grip]\nxyz_mm = [0.0, 1.5, 120]\nzyx_deg = [90, 0, -45.5]\nmass_kg = 2.5\n\
                cog_mm = [0, 0, 60]\n[frames.table]\nxyz_mm = [500, -100, 20]\nquaternion = [1, 0, 0, 0]\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("f.toml");
    common::mutants(&[seed], |text| {
        std::fs::write(&path, text).unwrap();
        let Ok(frames) = load_frames(&path) else { return false };
        assert!(frames.world.iter().all(is_rigid), "{text}");
        assert!(frames.frames.values().all(|f| is_rigid(f.as_ref().unwrap())), "{text}");
        for t in frames.tools.values().map(|t| t.as_ref().unwrap()) {
            assert!(is_rigid(&t.flange_from_tool) && t.mass.is_finite() && t.mass >= 0.0, "{text}");
            assert!(t.cog.iter().all(|x| x.is_finite()), "{text}");
        }
        true
    });
    std::fs::write(&path, "[tools.A]\nxyz_mm = [0, 0, 1]\n[tools.a]\nxyz_mm = [0, 0, 2]\n").unwrap();
    assert!(load_frames(&path).unwrap_err().to_string().contains("[tools.a]: stands there twice"));
}
