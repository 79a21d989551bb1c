//! Robot programs of every dialect, and the tools and frames that come with them.

use std::sync::LazyLock;

use trical_model::{Basis, Cell, Model, Motion, Pose, Robot, Site, Term};
use trical_program::{Dialect, Frame, Frames, MARK, Options, Program, compensate};

/// The nominal IRB 120, and one whose base is 1 mm off and whose joint 2 is 0.001 rad off.
static ARMS: LazyLock<(Model, Model)> = LazyLock::new(|| {
    let robot = Robot::parse(include_str!("../../cells/irb120/robot.toml"), "robot.toml").unwrap();
    let cell = Cell::parse(include_str!("../../cells/irb120/cell.toml"), "cell.toml").unwrap();
    let nominal = Model::nominal(robot, cell);
    let mut real = nominal.clone();
    let sites = [Site::Base(Motion::ALL[0]), Site::Joint { joint: 2 }];
    real.terms = sites.map(|site| Term { value: 1e-3, ..Term::new("t", "t", site, Basis::CONSTANT) }).to_vec();
    (nominal, real)
});

/// Tools 1 and 2 and frame 1, for listings that name no more than numbers.
static FRAMES: LazyLock<Frames> = LazyLock::new(|| {
    let at = |z: f64| Ok(Frame::massless(Pose { translation: [0.0, 0.0, z].into(), ..Pose::identity() }));
    Frames {
        tools: [("1".into(), at(0.118)), ("2".into(), at(0.14))].into(),
        frames: [("1".into(), at(0.0))].into(),
        world: None,
    }
});

/// Scans and, where it is short, rewrites it. Says whether there was a target that could be rewritten.
fn rewritten(bytes: &[u8], dialect: Dialect) -> bool {
    let Ok(scan) = dialect.scan(bytes) else { return false };
    assert!(scan.spots.iter().all(|s| scan.at(s) < bytes.len()));
    if bytes.len() > 1 << 14 {
        return false;
    }
    let (nominal, real) = &*ARMS;
    let run = |bytes: &[u8], sink: &mut Vec<u8>| {
        compensate(Program::of_file(bytes, "p", dialect, sink), nominal, real, &FRAMES, &Options::default())
    };
    let mut out = Vec::new();
    let Ok(report) = run(bytes, &mut out) else { return false };
    let text = String::from_utf8_lossy(&out);
    assert!(text.contains(MARK), "{text}");
    // what came out is a program of the same targets, and is not taken twice
    let again = dialect.scan(&out).unwrap_or_else(|e| panic!("{e}\n{text}"));
    assert_eq!(again.spots.len(), scan.spots.len(), "{text}");
    assert!(run(&out, &mut Vec::new()).is_err(), "{text}");
    report.rewritten > 0
}

/// ABB RAPID.
pub fn rapid(data: &[u8]) -> bool {
    rewritten(data, Dialect::Rapid)
}

/// KUKA KRL.
pub fn krl(data: &[u8]) -> bool {
    rewritten(data, Dialect::Krl)
}

/// A FANUC listing.
pub fn fanuc(data: &[u8]) -> bool {
    rewritten(data, Dialect::Fanuc)
}

/// Universal Robots script.
pub fn urscript(data: &[u8]) -> bool {
    rewritten(data, Dialect::UrScript)
}

/// A table of poses or joint values.
pub fn csv(data: &[u8]) -> bool {
    rewritten(data, Dialect::Csv)
}

fn is_rigid(p: &Pose) -> bool {
    let r = p.rotation * p.rotation.transpose();
    (r - nalgebra::Matrix3::identity()).amax() < 1e-9 && p.translation.iter().all(|x| x.is_finite())
}

/// A file of tools and frames (`--frames`): only rigid transforms.
pub fn frames(data: &[u8]) -> bool {
    let Ok(text) = std::str::from_utf8(data) else { return false };
    let Ok(frames) = Frames::parse(text, "f.toml") else { return false };
    assert!(frames.world.iter().all(is_rigid), "{text}");
    for t in frames.tools.values().chain(frames.frames.values()).map(|t| t.as_ref().unwrap()) {
        assert!(is_rigid(&t.parent_from_frame) && t.mass.is_finite() && t.mass >= 0.0, "{text}");
        assert!(t.cog.iter().all(|x| x.is_finite()), "{text}");
    }
    true
}
